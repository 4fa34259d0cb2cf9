//! Shaders put together from the workspace's folder `shaders`.
//!
//! Three lines are read beside WGSL: `//#include shared/ray.wgsl` (once each), `//#if NAME` with `//#else` and `//#end`. What is put together knows of
//! each of its lines where it stands, so that an error of a driver can be found.

use std::collections::BTreeSet;

/// The files, by their path in the folder.
pub const FILES: &[(&str, &str)] = &[
    ("lattice/add.wgsl", include_str!("../../../shaders/lattice/add.wgsl")),
    ("lattice/cells.wgsl", include_str!("../../../shaders/lattice/cells.wgsl")),
    ("lattice/count.wgsl", include_str!("../../../shaders/lattice/count.wgsl")),
    ("lattice/decided.wgsl", include_str!("../../../shaders/lattice/decided.wgsl")),
    ("lattice/open.wgsl", include_str!("../../../shaders/lattice/open.wgsl")),
    ("lattice/signs.wgsl", include_str!("../../../shaders/lattice/signs.wgsl")),
    ("lattice/triangles.wgsl", include_str!("../../../shaders/lattice/triangles.wgsl")),
    ("lattice/vertices.wgsl", include_str!("../../../shaders/lattice/vertices.wgsl")),
    ("lattice/words.wgsl", include_str!("../../../shaders/lattice/words.wgsl")),
    ("render/cast.wgsl", include_str!("../../../shaders/render/cast.wgsl")),
    ("render/rays.wgsl", include_str!("../../../shaders/render/rays.wgsl")),
    ("segment/histogram.wgsl", include_str!("../../../shaders/segment/histogram.wgsl")),
    ("segment/label.wgsl", include_str!("../../../shaders/segment/label.wgsl")),
    ("shared/bricks.wgsl", include_str!("../../../shaders/shared/bricks.wgsl")),
    ("shared/light.wgsl", include_str!("../../../shaders/shared/light.wgsl")),
    ("shared/pass.wgsl", include_str!("../../../shaders/shared/pass.wgsl")),
    ("shared/ray.wgsl", include_str!("../../../shaders/shared/ray.wgsl")),
    ("shared/scan.wgsl", include_str!("../../../shaders/shared/scan.wgsl")),
    ("shared/stored.wgsl", include_str!("../../../shaders/shared/stored.wgsl")),
    ("shared/volume.wgsl", include_str!("../../../shaders/shared/volume.wgsl")),
    ("shared/warp.wgsl", include_str!("../../../shaders/shared/warp.wgsl")),
    ("volume/ranges.wgsl", include_str!("../../../shaders/volume/ranges.wgsl")),
    ("warp/linear.wgsl", include_str!("../../../shaders/warp/linear.wgsl")),
];

/// A shader as a driver gets it.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Shader {
    /// WGSL.
    pub text: String,
    /// Of each line its file and its number there.
    pub lines: Vec<(&'static str, usize)>,
}

impl Shader {
    /// Where a line of the text (from 1) stands.
    pub fn place(&self, line: usize) -> String {
        self.lines
            .get(line.saturating_sub(1))
            .map_or_else(String::new, |(file, line)| format!("shaders/{file}:{line}"))
    }
}

/// Puts a file together with what it includes.
///
/// # Errors
/// Names the file and line of an include of a file that isn't there, or of a condition without its end.
pub fn assemble(file: &str, names: &[&str]) -> Result<Shader, String> {
    let mut shader = Shader::default();
    append(file, names, &mut BTreeSet::new(), &mut shader)?;
    Ok(shader)
}

fn append(
    file: &str,
    names: &[&str],
    seen: &mut BTreeSet<&'static str>,
    shader: &mut Shader,
) -> Result<(), String> {
    let Some((file, text)) = FILES.iter().find(|(name, _)| *name == file) else {
        return Err(format!("shaders/{file} isn't known"));
    };
    if !seen.insert(file) {
        return Ok(());
    }
    // Of each condition that is open, whether it holds.
    let mut open: Vec<bool> = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let wrong = |what: &str| format!("shaders/{file}:{}: {what}", number + 1);
        if let Some(name) = line.strip_prefix("//#if ") {
            open.push(names.contains(&name.trim()));
        } else if line == "//#else" {
            let last = open.last_mut().ok_or_else(|| wrong("#else without #if"))?;
            *last = !*last;
        } else if line == "//#end" {
            open.pop().ok_or_else(|| wrong("#end without #if"))?;
        } else if open.iter().all(|holds| *holds) {
            if let Some(other) = line.strip_prefix("//#include ") {
                append(other.trim(), names, seen, shader).map_err(|why| wrong(&why))?;
            } else {
                shader.text.push_str(line);
                shader.text.push('\n');
                shader.lines.push((file, number + 1));
            }
        }
    }
    if open.is_empty() { Ok(()) } else { Err(format!("shaders/{file}: #if without #end")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn includes_come_once_and_lines_know_where_they_stand() {
        let plain = assemble("render/cast.wgsl", &["DVR", "U8"]).unwrap();
        assert_eq!(plain.text.matches("struct Ray {").count(), 1);
        assert!(!plain.text.contains("fn before_of") && !plain.text.contains("//#"));
        let line = 1 + plain.text.lines().position(|line| line.starts_with("struct Ray {")).unwrap();
        assert_eq!(plain.place(line), "shaders/shared/ray.wgsl:2");
        let moved = assemble("render/cast.wgsl", &["DVR", "U8", "MOVED"]).unwrap();
        assert!(moved.text.contains("fn before_of"));
        assert!(assemble("render/none.wgsl", &[]).is_err());
    }
}
