use ivd_core::ParamError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How things are put together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Op {
    /// What any of them fills.
    #[default]
    Union,
    /// What all of them fill.
    Intersection,
    /// What the first fills and none of the others.
    Difference,
}

impl Op {
    /// Opacity of two operands together, each 0…1: `max(a, b)`, `min(a, b)`, `min(a, 1 − b)`.
    ///
    /// More than two are folded from left to right.
    #[inline]
    pub fn opacity(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Union => a.max(b),
            Self::Intersection => a.min(b),
            Self::Difference => a.min(1.0 - b),
        }
    }

    /// Label of two operands together, 0 standing for none; for masks the Boolean operation.
    #[inline]
    pub(super) fn label<T: PartialEq + Default>(self, a: T, b: T) -> T {
        let none = T::default();
        match self {
            Self::Union => {
                if a == none {
                    b
                } else {
                    a
                }
            }
            Self::Intersection => {
                if b == none {
                    none
                } else {
                    a
                }
            }
            Self::Difference => {
                if b == none {
                    a
                } else {
                    none
                }
            }
        }
    }
}

/// What a combination is.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct CombineParams {
    /// How they are put together.
    pub op: Op,
    /// Windows `[lo, hi]` of the opacity (real units of the operand), `lo < hi`: none (each volume's own range), one for all
    /// operands, or one for each. Labels and masks have none.
    #[schemars(extend("x-unit" = "real units", "x-alias" = ["window"]))]
    pub windows: Vec<[f64; 2]>,
}

impl CombineParams {
    /// Checks the parameters against a number of operands.
    ///
    /// # Errors
    /// Names the field that is out of its domain: less than two operands; a number of windows that is neither 0, 1 nor that of
    /// the operands; a window that isn't finite or whose `lo` isn't below its `hi`.
    pub fn check(&self, operands: usize) -> Result<(), ParamError> {
        if operands < 2 {
            let problem = format!("{operands} can't be combined");
            return Err(ParamError::new("operands", problem, "give two or more"));
        }
        let given = self.windows.len();
        if given > 1 && given != operands {
            let problem = format!("{given} windows for {operands} operands");
            return Err(ParamError::new(
                "window",
                problem,
                "give none, one for all, or one for each in their order",
            ));
        }
        for (n, window) in self.windows.iter().enumerate() {
            Window::new(*window).ok_or_else(|| {
                let [lo, hi] = window;
                let of = if given == 1 { String::new() } else { format!(" of operand {}", n + 1) };
                let problem = format!("{lo},{hi}{of} has no opacities between 0 and 1");
                ParamError::new("window", problem, "give lo,hi, two finite numbers with lo below hi")
            })?;
        }
        Ok(())
    }

    /// The window of operand `n`, counted from 0, where one is given.
    pub(super) fn window(&self, n: usize) -> Option<Window> {
        let given = if self.windows.len() == 1 { self.windows.first() } else { self.windows.get(n) };
        given.and_then(|window| Window::new(*window))
    }
}

/// Values between which opacity rises from 0 to 1 (real units).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Window {
    lo: f64,
    width: f64,
}

impl Window {
    /// Of values that are opacities already; stands in until a window is known.
    pub(super) const UNIT: Self = Self { lo: 0.0, width: 1.0 };

    /// `None` where the window isn't finite or holds no more than one value.
    pub(super) fn new([lo, hi]: [f64; 2]) -> Option<Self> {
        let width = hi - lo;
        (lo.is_finite() && hi.is_finite() && width.is_finite() && width > 0.0).then_some(Self { lo, width })
    }

    /// The window of a volume's own range; any window serves where nothing is data.
    ///
    /// # Errors
    /// A range of one value, or one that is wider than any number. `n`: the operand, counted from 0.
    pub(super) fn of_range(range: Option<[f64; 2]>, n: usize) -> Result<Self, ParamError> {
        let range = range.unwrap_or([0.0, 1.0]);
        Self::new(range).ok_or_else(|| {
            let [lo, hi] = range;
            let problem = if lo == hi {
                format!("operand {} holds one value only, {lo}: its own range is no window", n + 1)
            } else {
                format!("the range of operand {}, {lo} to {hi}, is too wide for a window", n + 1)
            };
            ParamError::new("window", problem, "give lo,hi with lo below hi, for all operands or for each")
        })
    }

    /// Opacity of a real value, never falling as the value rises; 0 for NaN.
    #[inline]
    pub(super) fn opacity(self, real: f64) -> f64 {
        let opacity = (real - self.lo) / self.width;
        // NaN isn't above 0.
        if opacity > 0.0 { opacity.min(1.0) } else { 0.0 }
    }

    /// The real value of an opacity.
    #[inline]
    pub(super) fn real(self, opacity: f64) -> f64 {
        self.lo + opacity * self.width
    }
}
