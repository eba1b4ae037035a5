//! From values to pixels, and where the ticks are.

/// A linear or logarithmic axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Scale {
    lo: f64,
    hi: f64,
    is_log: bool,
    /// Between ticks, where it is not for the room to decide.
    step: Option<f64>,
}

impl Scale {
    /// From `lo` to `hi` exactly.
    pub(crate) fn exact(lo: f64, hi: f64) -> Self {
        let hi = if hi > lo { hi } else { lo + 1.0 };
        Self {
            lo,
            hi,
            is_log: false,
            step: None,
        }
    }

    /// From `lo` to `hi` exactly, of things that are counted, with about `n_ticks`.
    pub(crate) fn counted(lo: f64, hi: f64, n_ticks: usize) -> Self {
        Self {
            step: Some(nice_step(hi - lo, n_ticks).ceil()),
            ..Self::exact(lo, hi)
        }
    }

    /// Round numbers around all `values`, with `n_ticks` or so between them.
    pub(crate) fn around(values: impl IntoIterator<Item = f64>, n_ticks: usize) -> Self {
        let (lo, hi) = extent(values);
        let step = nice_step(hi - lo, n_ticks);
        let (lo, hi) = ((lo / step).floor() * step, (hi / step).ceil() * step);
        Self {
            step: Some(step),
            ..Self::exact(lo, hi)
        }
    }

    /// Logarithmic, with a little room around all `values`, which are positive.
    pub(crate) fn magnitudes(values: impl IntoIterator<Item = f64>) -> Self {
        const ROOM: f64 = 1.2;
        let (lo, hi) = extent(values);
        Self {
            lo: lo / ROOM,
            hi: hi * ROOM,
            is_log: true,
            step: None,
        }
    }

    /// Where a value lies: 0 at the low end, 1 at the high end.
    pub(crate) fn place(&self, value: f64) -> f64 {
        if self.is_log {
            (value / self.lo).ln() / (self.hi / self.lo).ln()
        } else {
            (value - self.lo) / (self.hi - self.lo)
        }
    }

    /// Values of the ticks with their labels; room for about `n_ticks` where the scale leaves
    /// it open.
    pub(crate) fn ticks(&self, n_ticks: usize) -> Vec<(f64, String)> {
        if self.is_log {
            return self.log_ticks();
        }
        let step = self.step;
        let step = step.unwrap_or_else(|| nice_step(self.hi - self.lo, n_ticks));
        let first = (self.lo / step - 1e-9).ceil() as i64;
        let last = (self.hi / step + 1e-9).floor() as i64;
        (first..=last)
            .map(|k| k as f64 * step)
            .map(|value| (value, label(value, step)))
            .collect()
    }

    /// Powers of ten; over less than two decades also twice and five times them.
    fn log_ticks(&self) -> Vec<(f64, String)> {
        let (from, to) = (self.lo.log10().floor(), self.hi.log10().ceil());
        let times: &[f64] = if (self.hi / self.lo).log10() < 2.0 {
            &[1.0, 2.0, 5.0]
        } else {
            &[1.0]
        };
        let room = 1.0 + 1e-9;
        (from as i32..=to as i32)
            .flat_map(|power| times.iter().map(move |times| times * 10_f64.powi(power)))
            .filter(|value| (self.lo / room..=self.hi * room).contains(value))
            .map(|value| (value, label(value, value)))
            .collect()
    }
}

/// Least and greatest of the finite values; (0, 1) without any.
fn extent(values: impl IntoIterator<Item = f64>) -> (f64, f64) {
    let finite = values.into_iter().filter(|v| v.is_finite());
    let (lo, hi) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| {
        (lo.min(v), hi.max(v))
    });
    if lo <= hi { (lo, hi) } else { (0.0, 1.0) }
}

/// 1, 2, 2.5 or 5 times a power of ten, about `span / n`.
fn nice_step(span: f64, n: usize) -> f64 {
    let rough = if span > 0.0 { span } else { 1.0 } / n.max(1) as f64;
    let power = 10_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 2.5, 5.0, 10.0];
    let times = step.iter().find(|times| **times * power >= rough * 0.999);
    times.unwrap_or(&10.0) * power
}

/// As many decimals as the step needs; thousands as k, millions as M.
fn label(value: f64, step: f64) -> String {
    let (value, step, unit) = match value.abs().max(step.abs()) {
        size if size >= 1e6 => (value / 1e6, step / 1e6, "M"),
        size if size >= 1e4 => (value / 1e3, step / 1e3, "k"),
        _ => (value, step, ""),
    };
    if value.abs() < step.abs() * 1e-6 {
        return "0".into();
    }
    let n_decimals = (0..6)
        .find(|&n| {
            let scaled = step * 10_f64.powi(n);
            (scaled - scaled.round()).abs() < 1e-6 * scaled
        })
        .unwrap_or(6) as usize;
    let text = format!("{value:.n_decimals$}{unit}");
    text.replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(scale: Scale, n: usize) -> Vec<String> {
        scale.ticks(n).into_iter().map(|(_, label)| label).collect()
    }

    #[test]
    fn ticks_are_round_and_carry_what_they_need() {
        assert_eq!(
            labels(Scale::exact(0.0, 1.0), 4),
            ["0", "0.25", "0.50", "0.75", "1.00"]
        );
        assert_eq!(
            labels(Scale::around([-12.0, 37.0], 3), 3),
            ["−20", "0", "20", "40"]
        );
        assert_eq!(
            labels(Scale::counted(0.5, 12.5, 5), 9),
            ["3", "6", "9", "12"]
        );
        let steps = labels(Scale::exact(0.0, 300_000.0), 3);
        assert_eq!(steps, ["0", "100k", "200k", "300k"]);
        assert_eq!(
            labels(Scale::magnitudes([10.0, 10_000.0]), 4),
            ["10", "100", "1000", "10k"]
        );
    }

    #[test]
    fn ends_lie_at_zero_and_one_on_both_kinds_of_axis() {
        let log = Scale::magnitudes([12.0, 1_000.0 / 1.2]);
        for (scale, middle) in [(Scale::exact(0.0, 4.0), 2.0), (log, 100.0)] {
            assert!((scale.place(middle) - 0.5).abs() < 1e-12);
        }
        assert!(log.place(10.0).abs() < 1e-12);
    }

    #[test]
    fn values_that_do_not_spread_still_have_an_axis() {
        let scale = Scale::around([3.0, 3.0], 4);
        assert!(scale.place(3.0).is_finite() && !scale.ticks(4).is_empty());
        assert!(Scale::around([], 4).place(0.5).is_finite());
    }
}
