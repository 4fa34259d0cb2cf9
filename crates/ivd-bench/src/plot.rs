//! Plots as SVG.

use std::fmt::Write as _;

use ivd_report::html::{escape, number};

/// The plotted area and the room for its labels (SVG units).
pub(crate) const AREA: [f64; 2] = [600.0, 300.0];
pub(crate) const LEFT: f64 = 78.0;
pub(crate) const BOTTOM: f64 = 46.0;
pub(crate) const TOP: f64 = 12.0;
/// A logarithmic axis.
pub(crate) struct Axis {
    pub(crate) low: f64,
    pub(crate) high: f64,
    length: f64,
}

impl Axis {
    /// An axis round positive values with some room at both ends.
    pub(crate) fn new(values: impl Iterator<Item = f64>, length: f64) -> Self {
        let (low, high) = values.fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
        if !(low > 0.0 && low <= high) {
            return Self { low: 0.1, high: 10.0, length };
        }
        Self { low: low / 1.4, high: high * 1.4, length }
    }

    pub(crate) fn at(&self, value: f64) -> f64 {
        (value / self.low).ln() / (self.high / self.low).ln() * self.length
    }

    /// Round values along the axis: 1, 2 and 5 of every power of ten, or powers alone where there are many.
    fn ticks(&self) -> Vec<f64> {
        let decades = self.low.log10().floor() as i32..=self.high.log10().ceil() as i32;
        let wide = self.high / self.low > 3e3;
        let digits: &[f64] = if wide { &[1.0] } else { &[1.0, 2.0, 5.0] };
        decades
            .flat_map(|d| digits.iter().map(move |m| m * 10_f64.powi(d)))
            .filter(|t| (self.low..=self.high).contains(t))
            .collect()
    }
}

pub(crate) fn axes(svg: &mut String, x: &Axis, y: &Axis, x_label: &str, y_label: &str) {
    let (bottom, right) = (TOP + AREA[1], LEFT + AREA[0]);
    for tick in x.ticks() {
        let at = LEFT + x.at(tick);
        let _ = write!(
            svg,
            "<line class='grid' x1='{at:.1}' x2='{at:.1}' y1='{TOP}' y2='{bottom}'/>\
             <text class='small' x='{at:.1}' y='{}' text-anchor='middle'>{}</text>",
            bottom + 15.0,
            number(tick)
        );
    }
    for tick in y.ticks() {
        let at = bottom - y.at(tick);
        let _ = write!(
            svg,
            "<line class='grid' x1='{LEFT}' x2='{right}' y1='{at:.1}' y2='{at:.1}'/>\
             <text class='small' x='{}' y='{:.1}' text-anchor='end'>{}</text>",
            LEFT - 6.0,
            at + 4.0,
            number(tick)
        );
    }
    let middle = TOP + AREA[1] / 2.0;
    let _ = write!(
        svg,
        "<line class='axis' x1='{LEFT}' x2='{right}' y1='{bottom}' y2='{bottom}'/>\
         <line class='axis' x1='{LEFT}' x2='{LEFT}' y1='{TOP}' y2='{bottom}'/>\
         <text class='label' x='{}' y='{}' text-anchor='middle'>{}</text>\
         <text class='label' x='16' y='{middle}' text-anchor='middle' transform='rotate(-90 16 {middle})'>{}</text>",
        LEFT + AREA[0] / 2.0,
        bottom + 38.0,
        escape(x_label),
        escape(y_label)
    );
}

/// A named line through points.
pub(crate) struct Curve {
    pub(crate) name: String,
    pub(crate) points: Vec<[f64; 2]>,
}

/// Curves on logarithmic axes; points that are no positive numbers are left out.
pub(crate) fn curves(curves: &[Curve], x_label: &str, y_label: &str) -> String {
    let sound = |p: &&[f64; 2]| p.iter().all(|v| v.is_finite() && *v > 0.0);
    let values = |axis: usize| curves.iter().flat_map(|c| &c.points).filter(sound).map(move |p| p[axis]);
    let (x, y) = (Axis::new(values(0), AREA[0]), Axis::new(values(1), AREA[1]));
    let mut svg = format!(
        "<svg viewBox='0 0 {} {}' role='img' aria-label='{}'>",
        LEFT + AREA[0] + 12.0,
        TOP + AREA[1] + BOTTOM,
        escape(y_label)
    );
    axes(&mut svg, &x, &y, x_label, y_label);
    for (at, (curve, class)) in curves.iter().zip(["front", "other"]).enumerate() {
        let places: Vec<[f64; 2]> = curve
            .points
            .iter()
            .filter(sound)
            .map(|p| [LEFT + x.at(p[0]), TOP + AREA[1] - y.at(p[1])])
            .collect();
        let corners: Vec<String> = places.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
        let _ = write!(svg, "<polyline class='line {class}-line' points='{}'/>", corners.join(" "));
        for [px, py] in &places {
            let _ = write!(svg, "<circle class='{class}' cx='{px:.1}' cy='{py:.1}' r='4'/>");
        }
        let _ = write!(
            svg,
            "<text class='label {class}' x='{}' y='{}'>{}</text>",
            LEFT + 14.0,
            TOP + 18.0 * (1 + at) as f64,
            escape(&curve.name)
        );
    }
    svg + "</svg>"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_spans_its_values_and_ticks_lie_on_it() {
        let axis = Axis::new([3.0, 40.0].into_iter(), 100.0);
        assert!(axis.at(3.0) > 0.0 && axis.at(40.0) < 100.0);
        assert_eq!(axis.ticks(), [5.0, 10.0, 20.0, 50.0]);
        let none = Axis::new(std::iter::empty(), 100.0);
        assert!(none.at(1.0).is_finite());
    }
}
