use std::borrow::Cow;

use crate::record::Bench;

/// The points as comma-separated values, a line each, with a line of names.
pub fn table(bench: &Bench) -> String {
    let mut text = String::new();
    let names = [
        "stage",
        "input",
        "task",
        "knobs",
        "default",
        "on_front",
        "wall_s",
        "wall_least_s",
        "wall_most_s",
        "cpu_s",
        "cpu_least_s",
        "cpu_most_s",
        "peak_rss_mb",
        "error",
        "measure",
        "unit",
        "counters",
    ];
    let mut line = |fields: &[String]| {
        text.push_str(&fields.iter().map(|field| quoted(field)).collect::<Vec<_>>().join(","));
        text.push('\n');
    };
    line(&names.map(str::to_owned));
    for stage in &bench.stages {
        for point in &stage.points {
            let pairs = |of: Vec<String>| of.join("; ");
            line(&[
                stage.stage.clone(),
                stage.input.clone(),
                point.task.clone(),
                pairs(point.knobs.iter().map(|(n, v)| format!("{n}={v}")).collect()),
                point.default.to_string(),
                point.on_front.to_string(),
                point.wall_s.median.to_string(),
                point.wall_s.least.to_string(),
                point.wall_s.most.to_string(),
                point.cpu_s.median.to_string(),
                point.cpu_s.least.to_string(),
                point.cpu_s.most.to_string(),
                point.peak_rss_mb.map_or_else(String::new, |v| v.to_string()),
                point.error.to_string(),
                stage.measure.clone(),
                stage.unit.clone(),
                pairs(point.counters.iter().map(|(n, v)| format!("{n}={v}")).collect()),
            ]);
        }
    }
    text
}

/// A field as RFC 4180 has it: in quotes, its own doubled, where it holds a comma, a quote or the end of a line.
fn quoted(field: &str) -> Cow<'_, str> {
    if field.contains([',', '"', '\n', '\r']) {
        Cow::Owned(format!("\"{}\"", field.replace('"', "\"\"")))
    } else {
        Cow::Borrowed(field)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::tests::{point, stage};

    #[test]
    fn a_line_for_every_point_and_one_of_names() {
        let stages = vec![stage(vec![point("1", 1.0, 0.5), point("2, or so", 1.0, 0.5)])];
        let text = table(&Bench { schema: 1, version: String::new(), threads: 2, repeats: 3, stages });
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 3);
        assert!(lines[0].starts_with("stage,input,task,knobs,default"));
        assert!(lines[2].contains("\"step=2, or so\""));
    }

    #[test]
    fn only_fields_that_need_quotes_have_them() {
        for (field, written) in [
            ("plain; 1.5", "plain; 1.5"),
            ("", ""),
            ("a,b", "\"a,b\""),
            ("5\"", "\"5\"\"\""),
            ("a\nb", "\"a\nb\""),
        ] {
            assert_eq!(quoted(field), written);
        }
    }
}
