//! Which holds of the lens say nothing of the policy, as SQL.

/// SQL of whether the column `held` of a step has a cause that everybody may know. A hold that the policy caused could
/// unblind a session and is not among them: `Hold::caused_by_policy`.
macro_rules! held_openly {
    () => {
        "coalesce(held IN ('paused', 'focus-held', 'lens-failed', 'camera-failed'), FALSE)"
    };
}

#[cfg(test)]
mod tests {
    use parfocal_base::step::Hold;

    #[test]
    fn only_holds_that_the_policy_did_not_cause_are_open() {
        let all = [
            Hold::PolicyPanicked,
            Hold::PolicyNonsense,
            Hold::PolicySlow,
            Hold::PolicyUnavailable,
            Hold::LensFailed,
            Hold::CameraFailed,
            Hold::Paused,
            Hold::FocusHeld,
        ];
        for hold in all {
            let is_open = held_openly!().contains(&format!("'{}'", hold.name()));
            assert_eq!(is_open, !hold.caused_by_policy(), "{hold:?}");
        }
    }
}
