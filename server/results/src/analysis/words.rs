//! Numbers as they are written in sentences.

use super::statistics::Interval;
use parfocal_base::statistics::Method;

/// `value` to `places` decimal places, with a typographic minus sign.
pub fn decimals(value: f64, places: usize) -> String {
    let text = format!("{value:.places$}");
    let is_zero = text.trim_start_matches('-').chars().all(|digit| matches!(digit, '0' | '.'));
    if is_zero { text.trim_start_matches('-').to_owned() } else { text.replace('-', "−") }
}

/// A p value in words.
pub fn p_words(p: f64) -> String {
    if p < 0.0001 { "p < 0.0001".to_owned() } else { format!("p = {p:.4}") }
}

/// How a p value was computed, in words.
pub const fn method_words(method: Method) -> &'static str {
    match method {
        Method::Exact => "exact",
        Method::NormalApproximation => "normal approximation",
    }
}

/// An interval as it follows its statistic; empty for `None`.
pub fn interval_words(interval: Option<&Interval>, places: usize) -> String {
    interval.map_or_else(String::new, |Interval { low, high }| {
        format!(" (95 % interval {} to {})", decimals(*low, places), decimals(*high, places))
    })
}

/// `count` and the name of the thing; its plural must end in s.
pub fn counted(count: usize, thing: &str) -> String {
    if count == 1 { format!("1 {thing}") } else { format!("{count} {thing}s") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rounded_zero_has_no_sign_and_a_small_p_no_digits() {
        assert_eq!(decimals(-0.001, 2), "0.00");
        assert_eq!(decimals(-1.25, 1), "−1.2");
        assert_eq!(p_words(0.00001), "p < 0.0001");
        assert_eq!(p_words(0.05), "p = 0.0500");
        assert_eq!(counted(1, "surgeon"), "1 surgeon");
    }
}
