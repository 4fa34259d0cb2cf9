//! Lines over an axis as inline SVG.

use std::fmt::Write as _;

use crate::chart::{AREA, Axes, LEFT, axes, open};
use crate::html::number;

/// Points joined by a line.
pub struct Curve<'a> {
    /// Abscissa and ordinate, by abscissa.
    pub points: &'a [(f64, f64)],
    /// Label of the horizontal axis, with its unit.
    pub x_label: &'a str,
    /// Label of the vertical axis.
    pub y_label: &'a str,
    /// The abscissa that was chosen.
    pub chosen: Option<f64>,
}

/// The line with its points; nothing where there are fewer than two.
pub fn curve(found: &Curve<'_>) -> String {
    let finite: Vec<(f64, f64)> =
        found.points.iter().copied().filter(|(x, y)| x.is_finite() && y.is_finite()).collect();
    let [Some(first), Some(last)] = [finite.first(), finite.last()] else { return String::new() };
    let (low, high) = finite.iter().fold((f64::MAX, f64::MIN), |(a, b), (_, y)| (a.min(*y), b.max(*y)));
    if finite.len() < 2 || last.0 <= first.0 {
        return String::new();
    }
    let span = if high > low { high - low } else { 1.0 };
    let place = |(x, y): (f64, f64)| {
        let across = LEFT + (x - first.0) / (last.0 - first.0) * AREA[0];
        (across, 8.0 + (1.0 - (y - low) / span) * (AREA[1] - 16.0))
    };
    let mut svg = open();
    let line: Vec<String> = finite.iter().map(|p| place(*p)).map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
    let _ = write!(svg, "<polyline points='{}' class='line'/>", line.join(" "));
    for point in &finite {
        let (x, y) = place(*point);
        let chosen = found.chosen.is_some_and(|c| c == point.0);
        let _ = write!(
            svg,
            "<circle cx='{x:.1}' cy='{y:.1}' r='{}' class='{}'><title>{}: {}</title></circle>",
            if chosen { 5 } else { 3 },
            if chosen { "chosen" } else { "point" },
            number(point.0),
            number(point.1)
        );
    }
    for (y, value) in [(14.0, high), (AREA[1] - 6.0, low)] {
        let _ = write!(svg, "<text x='{}' y='{y:.1}' class='small'>{}</text>", LEFT + 4.0, number(value));
    }
    axes(&mut svg, &Axes { range: [first.0, last.0], x_label: found.x_label, y_label: found.y_label });
    svg + "</svg>"
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(points: &[(f64, f64)], chosen: Option<f64>) -> String {
        curve(&Curve { points, x_label: "K", y_label: "BIC", chosen })
    }

    #[test]
    fn every_point_is_drawn_once_and_the_chosen_one_stands_out() {
        let svg = drawn(&[(1.0, 9.0), (2.0, 4.0), (3.0, 5.0)], Some(2.0));
        assert_eq!(svg.matches("<circle").count(), 3);
        assert_eq!(svg.matches("class='chosen'").count(), 1);
        assert!(svg.contains("<title>2: 4</title>"));
    }

    #[test]
    fn what_cannot_be_drawn_is_left_out() {
        assert_eq!(drawn(&[], None), "");
        assert_eq!(drawn(&[(1.0, 2.0)], None), "");
        assert!(drawn(&[(1.0, 2.0), (2.0, f64::NAN), (3.0, 2.0)], None).matches("<circle").count() == 2);
    }
}
