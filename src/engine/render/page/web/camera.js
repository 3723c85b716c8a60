// The camera, as src/view/camera.rs has it: azimuth and elevation in degrees, a parallel projection.

const SIDES = { free: null, default: [30, 30], iso: [225, 35.264], top: [180, 90], bottom: [180, -90], south: [180, 0], north: [0, 0], east: [270, 0], west: [90, 0] };

const radians = degrees => degrees * Math.PI / 180;

// The world directions that are to the right and up in the picture.
function screenAxes([azimuth, elevation]) {
  const [a, e] = [azimuth, elevation].map(radians);
  return {
    right: [-Math.cos(a), -Math.sin(a), 0],
    up: [Math.sin(e) * Math.sin(a), -Math.sin(e) * Math.cos(a), Math.cos(e)],
  };
}

// The direction towards the eye.
function nearness(view) {
  const { right: [a, b, c], up: [d, e, f] } = screenAxes(view);
  return [b * f - c * e, c * d - a * f, a * e - b * d];
}

// The view after a drag by so many pixels of a picture of this height: half a turn along it.
function turned([azimuth, elevation], [dx, dy], height) {
  const degrees = 180 / height;
  const angle = ((azimuth - dx * degrees) % 360 + 360) % 360;
  return [Number(angle.toFixed(2)), Number(Math.min(Math.max(elevation + dy * degrees, -90), 90).toFixed(2))];
}

// The point that is so many world units to the right of another, and up from it.
function beside(point, view, [across, along]) {
  const { right, up } = screenAxes(view);
  return point.map((at, axis) => at + across * right[axis] + along * up[axis]);
}
