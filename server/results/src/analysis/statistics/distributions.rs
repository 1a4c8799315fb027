//! The distributions for p values and intervals: chi-square and F.

/// Number of terms after which a series or continued fraction has certainly converged.
const TERMS: u32 = 500;
/// Relative change below which a series has converged.
const PRECISION: f64 = 1e-16;

/// ln Γ(x) for x > 0: Lanczos's approximation with g = 7 and nine terms (Godfrey 2001), good to 15 digits.
fn ln_gamma(x: f64) -> f64 {
    const LANCZOS: [f64; 9] = [
        0.999_999_999_999_809_9,
        676.520_368_121_885_1,
        -1_259.139_216_722_402_8,
        771.323_428_777_653_1,
        -176.615_029_162_140_6,
        12.507_343_278_686_905,
        -0.138_571_095_265_720_12,
        9.984_369_578_019_572e-6,
        1.505_632_735_149_311_6e-7,
    ];

    let x = x - 1.0;
    let sum = LANCZOS[1..].iter().zip(1..).fold(LANCZOS[0], |sum, (term, place)| sum + term / (x + f64::from(place)));
    let t = x + 7.5;
    0.5 * (2.0 * std::f64::consts::PI).ln() + (x + 0.5) * t.ln() - t + sum.ln()
}

/// The probability that chi-square with `df` degrees of freedom exceeds `x`: the regularised upper incomplete gamma
/// function Q(df / 2, x / 2), by its series below the mean and its continued fraction above (DLMF 8.7.1, 8.9.2).
pub fn chi_square_above(x: f64, df: f64) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    let a = 0.5 * df;
    let x = 0.5 * x;
    let scale = (a * x.ln() - x - ln_gamma(a)).exp();

    if x < a + 1.0 {
        let mut term = 1.0 / a;
        let mut sum = term;
        for place in 1..TERMS {
            term *= x / (a + f64::from(place));
            sum += term;
            if term < sum * PRECISION {
                break;
            }
        }
        return 1.0 - scale * sum;
    }

    let below = |place: u32| x + f64::from(2 * place + 1) - a;
    let above = |place: u32| f64::from(place) * (f64::from(place) - a);
    let fraction = (1..TERMS).rev().fold(below(TERMS), |tail, place| below(place) - above(place + 1) / tail);
    scale / (below(0) - above(1) / fraction)
}

/// The regularised incomplete beta function by its continued fraction (DLMF 8.17.22), evaluated from its end.
fn beta_below(x: f64, a: f64, b: f64) -> f64 {
    if x <= 0.0 {
        return 0.0;
    }
    if x >= 1.0 {
        return 1.0;
    }
    // The fraction converges fast below this point; above it the function is mirrored.
    if x > (a + 1.0) / (a + b + 2.0) {
        return 1.0 - beta_below(1.0 - x, b, a);
    }

    let term = |place: u32| {
        let m = f64::from(place / 2);
        if place.is_multiple_of(2) {
            m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m))
        } else {
            -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0))
        }
    };
    let fraction = (1..TERMS).rev().fold(1.0, |tail, place| 1.0 + term(place) / tail);
    let ln_scale = a * x.ln() + b * (-x).ln_1p() + ln_gamma(a + b) - ln_gamma(a) - ln_gamma(b);
    ln_scale.exp() / (a * fraction)
}

/// The probability that F with `above` and `below` degrees of freedom is at most `f`.
pub fn f_at_most(f: f64, above: f64, below: f64) -> f64 {
    beta_below(above * f / (above * f + below), 0.5 * above, 0.5 * below)
}

/// The value that F with `above` and `below` degrees of freedom exceeds with probability 1 - `share`, by bisection.
pub fn f_quantile(share: f64, above: f64, below: f64) -> f64 {
    let mut low = 0.0;
    let mut high = 1.0;
    while f_at_most(high, above, below) < share && high < 1e12 {
        high *= 2.0;
    }
    for _ in 0..200 {
        let middle = f64::midpoint(low, high);
        if f_at_most(middle, above, below) < share {
            low = middle;
        } else {
            high = middle;
        }
    }
    f64::midpoint(low, high)
}
