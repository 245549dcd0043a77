//! The columns of measurement files, beside those that name configuration and load.

pub const DEFLECTION: [&str; 3] = ["dx_mm", "dy_mm", "dz_mm"];
pub const DEFLECTION_SIGMA: [&str; 3] = ["sx_mm", "sy_mm", "sz_mm"];
pub const ROTATION: [&str; 3] = ["rx_mrad", "ry_mrad", "rz_mrad"];
pub const ROTATION_SIGMA: [&str; 3] = ["srx_mrad", "sry_mrad", "srz_mrad"];
/// Positions that the instrument shows, in place of their difference.
pub const UNLOADED: [&str; 3] = ["unloaded_x_mm", "unloaded_y_mm", "unloaded_z_mm"];
pub const LOADED: [&str; 3] = ["loaded_x_mm", "loaded_y_mm", "loaded_z_mm"];
pub const UNLOADED_SIGMA: [&str; 3] = ["unloaded_sx_mm", "unloaded_sy_mm", "unloaded_sz_mm"];
pub const LOADED_SIGMA: [&str; 3] = ["loaded_sx_mm", "loaded_sy_mm", "loaded_sz_mm"];
/// Which readings these are: the number of the stop, and that of the reading there.
pub const PLACES: [&str; 4] = [
    "unloaded_stop",
    "unloaded_reading",
    "loaded_stop",
    "loaded_reading",
];
