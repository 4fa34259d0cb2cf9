//! Names of flags, and values of arguments: pairs, sizes, parameters. Those that a scene knows too are read where the scene is.

use std::path::Path;

use ivd_core::ParamError;
use ivd_io::volume::VoxelAxes;
use ivd_pipeline::Depth;
use ivd_pipeline::params::from_toml;
use ivd_pipeline::scene::{MAX_SCENE_BYTES, read_text_limited, truncate_lines};
use toml::Table;

use crate::exit::Failure;

/// The flag of a key.
pub(crate) fn flag(key: &str) -> String {
    key.replace('_', "-")
}

/// `az,el` in degrees.
pub(crate) fn pair(text: &str) -> Result<[f64; 2], String> {
    let parts: Vec<f64> = text
        .split(',')
        .map(|p| p.trim().parse::<f64>())
        .collect::<Result<_, _>>()
        .map_err(|e| format!("`{text}`: {e}; write az,el"))?;
    parts.try_into().map_err(|_| format!("`{text}`: write two numbers, az,el"))
}

/// `low,high`, two values.
pub(crate) fn interval(text: &str) -> Result<[f64; 2], String> {
    pair(text).map_err(|_| format!("`{text}`: write two numbers, low,high"))
}

/// Which frames of a motion are meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Frames {
    /// One, counted from 0.
    One(usize),
    /// All.
    All,
}

/// `N` or `all`, frames of a motion.
pub(crate) fn frames(text: &str) -> Result<Frames, String> {
    match text.trim() {
        "all" => Ok(Frames::All),
        number => number
            .parse()
            .map(Frames::One)
            .map_err(|_| format!("`{text}`: write the number of a frame, counted from 0, or all")),
    }
}

/// Bits of a channel of a PNG.
pub(crate) fn depth(text: &str) -> Result<Depth, String> {
    match text.trim() {
        "8" => Ok(Depth::Eight),
        "16" => Ok(Depth::Sixteen),
        _ => Err(format!("`{text}`: write 8 or 16")),
    }
}

/// Three letters, where axes lead.
pub(crate) fn axes(text: &str) -> Result<VoxelAxes, String> {
    text.parse().map_err(|e: ParamError| e.to_string())
}

/// `X,Y,Z` voxels.
pub(crate) fn dims(text: &str) -> Result<[usize; 3], String> {
    let parts: Vec<usize> = text
        .split([',', 'x'])
        .map(|p| p.trim().parse::<usize>())
        .collect::<Result<_, _>>()
        .map_err(|e| format!("`{text}`: {e}; write X,Y,Z"))?;
    parts.try_into().map_err(|_| format!("`{text}`: write three counts, X,Y,Z"))
}

/// `X,Y,Z`, a place (mm).
pub(crate) fn place(text: &str) -> Result<[f64; 3], String> {
    let parts: Vec<f64> = text
        .split(',')
        .map(|p| {
            p.trim()
                .parse::<f64>()
                .ok()
                .filter(|c| c.is_finite())
                .ok_or_else(|| format!("`{text}`: `{p}` is no number; write X,Y,Z in mm"))
        })
        .collect::<Result<_, _>>()?;
    parts.try_into().map_err(|_| format!("`{text}`: write three numbers, X,Y,Z in mm"))
}

/// `X,Y,Z`, a voxel; −1 and n are the border layer.
pub(crate) fn voxel(text: &str) -> Result<[i64; 3], String> {
    let parts: Vec<i64> = text
        .split(',')
        .map(|p| p.trim().parse::<i64>())
        .collect::<Result<_, _>>()
        .map_err(|e| format!("`{text}`: {e}; write X,Y,Z"))?;
    parts.try_into().map_err(|_| format!("`{text}`: write three voxel numbers, X,Y,Z"))
}

/// Bytes with an optional unit: `2G`, `512MiB`, `1000000`.
pub(crate) fn bytes(text: &str) -> Result<u64, String> {
    let lower = text.trim().to_lowercase();
    let split = lower.find(|c: char| !(c.is_ascii_digit() || c == '.')).unwrap_or(lower.len());
    let number: f64 =
        lower[..split].parse().map_err(|_| format!("`{text}`: write a number of bytes, such as 4GiB"))?;
    let factor = match lower[split..].trim() {
        "" | "b" => 1_u64,
        "k" | "kib" => 1 << 10,
        "kb" => 1_000,
        "m" | "mib" => 1 << 20,
        "mb" => 1_000_000,
        "g" | "gib" => 1 << 30,
        "gb" => 1_000_000_000,
        "t" | "tib" => 1 << 40,
        unit => return Err(format!("`{text}`: unknown unit `{unit}`; use K, M, G, T, KiB, MB, …")),
    };
    Ok((number * factor as f64) as u64)
}

/// The table in a file of parameters.
fn toml_of(file: &Path) -> anyhow::Result<Table> {
    let bytes = read_text_limited(file)
        .map_err(|e| Failure::of(ivd_core::ErrorClass::Io, format!("reading {}: {e}", file.display())))?;
    let wrong = |problem: String| Failure::usage(format!("--params {}: {problem}", file.display()));
    let bytes = bytes.ok_or_else(|| wrong(format!("longer than {MAX_SCENE_BYTES} bytes")))?;
    let text = String::from_utf8(bytes).map_err(|e| wrong(format!("{e}; write a TOML text file")))?;
    text.parse::<Table>().map_err(|e| wrong(truncate_lines(&e.to_string())))
}

/// The keys in a file of parameters, as JSON.
pub(crate) fn table_of(file: &Path) -> anyhow::Result<serde_json::Map<String, serde_json::Value>> {
    let mut keys = serde_json::Map::new();
    for (key, value) in toml_of(file)? {
        let value = from_toml(value).map_err(|problem| {
            Failure::usage(format!("--params {}: {}", file.display(), problem.told_of(&key)))
        })?;
        keys.insert(key, value);
    }
    Ok(keys)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_units() {
        assert_eq!(bytes("2GiB"), Ok(2 << 30));
        assert_eq!(bytes("1.5k"), Ok(1536));
        assert_eq!(bytes("10MB"), Ok(10_000_000));
        assert!(bytes("10 parsecs").is_err());
    }
}
