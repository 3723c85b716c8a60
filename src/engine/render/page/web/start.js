
const about = JSON.parse(element('about').textContent);
window.player = new Player(about.live ? new Live(about) : new Stored(about));
if (about.live) window.steering = new Steering(window.player);
else window.player.show();
