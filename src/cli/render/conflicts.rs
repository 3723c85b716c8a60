//! Options that cannot be given together, by the names that clap knows them by.

/// How pictures are framed and splatted: parts have these options, and their sum takes them from the parts.
const OF_SPLATS: [&str; 22] = [
    "views",
    "orbit",
    "over_time",
    "key_frames",
    "roll",
    "size",
    "scale",
    "center",
    "exaggerate",
    "region",
    "tau",
    "sigma",
    "splat_error",
    "lod",
    "fast",
    "tolerance",
    "error",
    "error_image",
    "quantity",
    "mode",
    "transfer_function",
    "method",
];

/// How finished pictures are coloured and written.
const OF_COLOURS: [&str; 9] = ["colormap", "range", "norm", "background", "format", "depth", "fps", "speed", "sidecar"];

/// Time series.
const OF_SERIES: [&str; 2] = ["points", "regions"];

/// Options of pictures, which time series do not have.
pub(super) fn of_pictures() -> impl Iterator<Item = &'static str> {
    OF_SPLATS.into_iter().chain(OF_COLOURS).chain(["planes", "slices", "annotate", "partial", "sum"])
}

/// Options of whole pictures and of sums, which parts do not have.
pub(super) fn of_sums() -> impl Iterator<Item = &'static str> {
    OF_COLOURS.into_iter().chain(OF_SERIES).chain(["error_image", "clear", "bar_title", "theme"])
}

/// Options of parts, which sums take from them.
pub(super) fn of_parts() -> impl Iterator<Item = &'static str> {
    OF_SPLATS.into_iter().chain(OF_SERIES).chain(["iso", "planes", "missing_value", "skip_damaged"])
}
