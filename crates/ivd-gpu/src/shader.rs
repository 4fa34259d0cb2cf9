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
    ("lattice/tables.wgsl", include_str!("../../../shaders/lattice/tables.wgsl")),
    ("lattice/triangles.wgsl", include_str!("../../../shaders/lattice/triangles.wgsl")),
    ("lattice/vertices.wgsl", include_str!("../../../shaders/lattice/vertices.wgsl")),
    ("lattice/words.wgsl", include_str!("../../../shaders/lattice/words.wgsl")),
    ("render/cast.wgsl", include_str!("../../../shaders/render/cast.wgsl")),
    ("render/rays.wgsl", include_str!("../../../shaders/render/rays.wgsl")),
    ("segment/histogram.wgsl", include_str!("../../../shaders/segment/histogram.wgsl")),
    ("segment/label.wgsl", include_str!("../../../shaders/segment/label.wgsl")),
    ("shared/bricks.wgsl", include_str!("../../../shaders/shared/bricks.wgsl")),
    ("shared/lanes.wgsl", include_str!("../../../shaders/shared/lanes.wgsl")),
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
pub(crate) mod tests {
    use naga::valid::{Capabilities, ValidationFlags, Validator};

    use super::*;

    /// A shader as a device reads it, which needs no more than the least one has: eight buffers, 256 lanes, 16 KiB that they share, and these capabilities.
    pub(crate) fn valid(file: &str, names: &[&str], capabilities: Capabilities) -> naga::Module {
        let shader = assemble(file, names).unwrap();
        let module = naga::front::wgsl::parse_str(&shader.text).unwrap_or_else(|error| {
            let line = error.location(&shader.text).map_or(0, |location| location.line_number as usize);
            panic!("{names:?}: {}: {}", shader.place(line), error.emit_to_string(&shader.text))
        });
        let info = Validator::new(ValidationFlags::all(), capabilities)
            .validate(&module)
            .unwrap_or_else(|error| panic!("{file} {names:?}: {}", error.emit_to_string(&shader.text)));
        let global = |of: fn(naga::AddressSpace) -> bool| {
            let module = &module;
            module.global_variables.iter().filter(move |(_, variable)| of(variable.space))
        };
        assert!(
            global(|space| matches!(space, naga::AddressSpace::Storage { .. })).count() <= 8,
            "{file} {names:?}"
        );
        let mut layouts = naga::proc::Layouter::default();
        layouts.update(module.to_ctx()).unwrap();
        let shared = global(|space| space == naga::AddressSpace::WorkGroup);
        assert!(
            shared.map(|(_, variable)| layouts[variable.ty].size).sum::<u32>() <= 16 << 10,
            "{file} {names:?}"
        );
        let [x, y, z] = module.entry_points[0].workgroup_size;
        assert!(x * y * z <= 256, "{file} {names:?}");
        // What a shader declares it uses: its bindings are those that the entry point uses.
        let used = info.get_entry_point(0);
        for (handle, variable) in
            module.global_variables.iter().filter(|(_, variable)| variable.binding.is_some())
        {
            assert!(!used[handle].is_empty(), "{file} {names:?}: {:?} isn't used", variable.name);
        }
        module
    }

    #[test]
    fn every_shader_of_passes_over_data_is_valid_on_the_least_device() {
        let mut seen = BTreeSet::new();
        let mut check = |file: &'static str, names: &[&str], capabilities| {
            seen.insert(file);
            valid(file, names, capabilities);
        };
        let none = Capabilities::empty();
        let kinds =
            [&["U8", "BYTES"][..], &["I8", "BYTES"], &["U16", "HALVES"], &["I16", "HALVES"], &["F32"]];
        for kind in kinds {
            check("volume/ranges.wgsl", kind, none);
            check("lattice/signs.wgsl", kind, none);
            check("warp/linear.wgsl", kind, Capabilities::FLOAT64 | Capabilities::SHADER_INT64);
            for masked in [&[][..], &["MASKED"]] {
                check("segment/label.wgsl", &[kind, masked].concat(), none);
                if kind != ["F32"] {
                    check("segment/histogram.wgsl", &[kind, masked].concat(), none);
                    check("segment/histogram.wgsl", &[kind, masked, &["PAGES"]].concat(), none);
                }
            }
        }
        for file in ["count", "open", "add", "vertices", "triangles"] {
            let (file, _) = FILES.iter().find(|(name, _)| *name == format!("lattice/{file}.wgsl")).unwrap();
            check(file, &[], none);
        }
        check("shared/scan.wgsl", &[], none);
        check("shared/scan.wgsl", &["ADD"], none);
        // The others are pictures' or parts of these.
        let is_whole = |text: &str| text.contains("@compute") || text.contains("fn each(");
        let whole = FILES.iter().filter(|(_, text)| is_whole(text)).map(|(name, _)| *name);
        let left: Vec<&str> = whole.filter(|name| !seen.contains(name)).collect();
        assert_eq!(left, ["render/cast.wgsl", "render/rays.wgsl", "shared/lanes.wgsl"]);
    }

    #[test]
    fn no_barrier_stands_under_a_condition_of_data() {
        // Barriers stand in a function's own block or in a loop whose bound is a constant.
        for (file, text) in FILES {
            for (number, line) in text.lines().enumerate().filter(|(_, line)| line.contains("Barrier();")) {
                let indent = line.len() - line.trim_start().len();
                let rounds = text
                    .lines()
                    .take(number)
                    .filter(|l| l.len() - l.trim_start().len() + 4 == indent && l.ends_with('{'))
                    .last();
                let fine =
                    indent == 4 || rounds.is_some_and(|l| l.contains("for (var reach = 1u; reach < 256u;"));
                assert!(fine, "shaders/{file}:{}", number + 1);
            }
        }
    }

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
