//! Small charts as inline SVG.

use std::fmt::Write as _;

use crate::html::{escape, number};

/// Width and height of the plotted area (SVG units).
pub(crate) const AREA: [f64; 2] = [560.0, 160.0];
/// Room for the labels of the axes.
pub(crate) const LEFT: f64 = 46.0;
const BOTTOM: f64 = 34.0;
/// Room for the half of the last number that lies beyond the axis.
const RIGHT: f64 = 26.0;

/// Bars over an axis, with what is drawn over them.
pub struct Bars<'a> {
    /// Values at the left and right end of the axis.
    pub range: [f64; 2],
    /// Height of each bar.
    pub counts: &'a [u64],
    /// Label of the horizontal axis, with its unit.
    pub x_label: &'a str,
    /// Label of the vertical axis.
    pub y_label: &'a str,
    /// Whether heights are drawn as logarithms.
    pub logarithmic: bool,
    /// Vertical marks with a text.
    pub marks: Vec<(f64, String)>,
    /// Colour of the bar at a value.
    pub colour: &'a dyn Fn(f64) -> String,
    /// Lines over the bars.
    pub lines: Vec<Line>,
}

/// A line over bars.
pub struct Line {
    /// Its height at the middle of equal parts of the axis, in the unit of the bars.
    pub heights: Vec<f64>,
    /// Its colour, as CSS writes it.
    pub colour: String,
}

/// The bars as SVG.
pub fn bars(chart: &Bars<'_>) -> String {
    let height = |count: u64| if chart.logarithmic { (1.0 + count as f64).ln() } else { count as f64 };
    let top = chart.counts.iter().map(|&c| height(c)).fold(1e-9, f64::max);
    let width = AREA[0] / chart.counts.len().max(1) as f64;
    let mut svg = open();
    for (i, &count) in chart.counts.iter().enumerate() {
        if count == 0 {
            continue;
        }
        let h = height(count) / top * AREA[1];
        let value =
            chart.range[0] + (i as f64 + 0.5) / chart.counts.len() as f64 * (chart.range[1] - chart.range[0]);
        let colour = (chart.colour)(value);
        let _ = write!(
            svg,
            "<rect x='{:.2}' y='{:.2}' width='{:.2}' height='{h:.2}' fill='{colour}'><title>{}: {count}</title></rect>",
            LEFT + i as f64 * width,
            AREA[1] - h,
            width.max(0.6),
            number(value),
        );
    }
    let span = chart.range[1] - chart.range[0];
    for (value, text) in
        chart.marks.iter().filter(|(v, _)| span > 0.0 && *v >= chart.range[0] && *v <= chart.range[1])
    {
        let x = LEFT + (value - chart.range[0]) / span * AREA[0];
        let _ = write!(
            svg,
            "<line x1='{x:.1}' x2='{x:.1}' y1='0' y2='{}' class='mark'/><text x='{:.1}' y='10' class='small'>{}</text>",
            AREA[1],
            x + 3.0,
            escape(text)
        );
    }
    for line in &chart.lines {
        let of = |(i, count): (usize, &f64)| {
            let x = LEFT + (i as f64 + 0.5) / line.heights.len() as f64 * AREA[0];
            let h = if chart.logarithmic { (1.0 + count).ln() } else { *count };
            format!("{x:.1},{:.1}", AREA[1] - (h / top * AREA[1]).clamp(0.0, AREA[1]))
        };
        let points: Vec<String> = line.heights.iter().enumerate().map(of).collect();
        let colour = &line.colour;
        let _ =
            write!(svg, "<polyline points='{}' class='density' style='stroke:{colour}'/>", points.join(" "));
    }
    let y_label =
        if chart.logarithmic { format!("{} (log)", chart.y_label) } else { chart.y_label.to_owned() };
    axes(&mut svg, &Axes { range: chart.range, x_label: chart.x_label, y_label: &y_label });
    svg.push_str("</svg>");
    svg
}

pub(crate) fn open() -> String {
    format!("<svg viewBox='0 0 {} {}' role='img' class='chart'>", LEFT + AREA[0] + RIGHT, AREA[1] + BOTTOM)
}

/// The axes of a plotted area.
pub(crate) struct Axes<'a> {
    /// Values at the left and right end.
    pub(crate) range: [f64; 2],
    pub(crate) x_label: &'a str,
    pub(crate) y_label: &'a str,
}

pub(crate) fn axes(svg: &mut String, found: &Axes<'_>) {
    let _ = write!(
        svg,
        "<line x1='{LEFT}' x2='{}' y1='{1}' y2='{1}' class='axis'/><line x1='{LEFT}' x2='{LEFT}' y1='0' y2='{1}' class='axis'/>",
        LEFT + AREA[0],
        AREA[1]
    );
    for i in 0..=4 {
        let f = f64::from(i) / 4.0;
        let value = found.range[0] + f * (found.range[1] - found.range[0]);
        let _ = write!(
            svg,
            "<text x='{:.1}' y='{:.1}' class='small' text-anchor='middle'>{}</text>",
            LEFT + f * AREA[0],
            AREA[1] + 14.0,
            number(value)
        );
    }
    let _ = write!(
        svg,
        "<text x='{:.1}' y='{:.1}' class='label' text-anchor='middle'>{}</text>\
         <text x='12' y='{:.1}' class='label' text-anchor='middle' transform='rotate(-90 12 {:.1})'>{}</text>",
        LEFT + AREA[0] / 2.0,
        AREA[1] + 29.0,
        escape(found.x_label),
        AREA[1] / 2.0,
        AREA[1] / 2.0,
        escape(found.y_label)
    );
}

/// Counts of values in equal bins.
pub fn histogram(values: &[f64], range: [f64; 2], bins: usize) -> Vec<u64> {
    let mut counts = vec![0; bins];
    let span = range[1] - range[0];
    for value in values {
        let at = if span > 0.0 { (value - range[0]) / span * bins as f64 } else { 0.0 };
        counts[(at.max(0.0) as usize).min(bins - 1)] += 1;
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_falls_into_a_bin() {
        assert_eq!(histogram(&[0.0, 0.5, 1.0, 2.0], [0.0, 1.0], 2), vec![1, 3]);
    }
}
