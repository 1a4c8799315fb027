//! The sensor that the phantom is seen with.

/// Centre and full width at half maximum of each band's response, nm: one calibrated unit of the CMV2K-SSM4X4-VIS.
pub(super) const BANDS: [(f64, f64); 16] = [
    (570.5, 12.5),
    (576.9, 16.3),
    (586.9, 17.9),
    (594.9, 16.3),
    (532.0, 12.5),
    (544.4, 17.4),
    (550.8, 10.9),
    (560.0, 16.6),
    (496.0, 15.9),
    (503.0, 18.3),
    (513.3, 13.8),
    (524.1, 17.4),
    (460.1, 10.9),
    (468.5, 9.2),
    (475.4, 17.0),
    (484.5, 10.1),
];
