//! The numbers that Klimchik et al. 2012 print. Table 4 is in `scenarios/plans/`.

/// Eq. 23: rows x, y, z and columns k2 to k6, in N m^2, with one decimal.
pub const EQUATION_23: [[f64; 5]; 3] = [
    [-73.4, -177.4, -106.1, 102.4, 0.0],
    [0.0, 0.0, 197.2, 19.3, 0.0],
    [-363.6, -98.3, -167.1, -42.2, 0.0],
];

/// Half a unit of the last place of eq. 23 (N m^2) and of the angles of Table 2 (deg).
pub const HALF_A_PLACE: f64 = 0.05;

/// Table 5: the number of measurements, and the standard errors of k2 to k6 in 1e-9 rad/(N m).
pub const TABLE_5: [(u32, [f64; 5]); 5] = [
    (2, [6.55, 6.88, 24.0, 34.5, 71.9]),
    (3, [5.74, 6.87, 19.2, 26.4, 74.9]),
    (4, [3.72, 6.96, 16.9, 21.2, 66.9]),
    (6, [3.93, 4.82, 13.8, 16.4, 55.2]),
    (12, [2.78, 3.41, 9.75, 11.6, 38.8]),
];

/// Table 6: the numbers of measurements and of different configurations, and `rho_0` in um.
pub const TABLE_6: [(u32, u32, f64); 12] = [
    (2, 2, 5.989),
    (3, 3, 4.676),
    (4, 2, 4.235),
    (4, 4, 4.044),
    (6, 2, 3.458),
    (6, 3, 3.306),
    (6, 6, 3.228),
    (12, 2, 2.445),
    (12, 3, 2.338),
    (12, 4, 2.335),
    (12, 6, 2.283),
    (12, 12, 2.282),
];

/// The mean distance that Fig. 7 gives for random plans of twelve measurements (um).
pub const FIGURE_7_RANDOM: f64 = 3.43;

/// Fig. 7: the name of a plan, the number of measurements that it was designed for before it was
/// repeated to twelve, and the mean distance in um.
pub const FIGURE_7: [(&str, u32, f64); 5] = [
    ("2a", 2, 2.15),
    ("2b", 3, 2.09),
    ("2c", 4, 2.13),
    ("2d", 6, 2.17),
    ("2e", 12, 2.16),
];
