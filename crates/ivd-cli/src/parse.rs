//! Values of arguments: triples, sizes, handles.

use std::path::Path;

use ivd_pipeline::scene::{FixSection, HandleSection};
use serde::de::DeserializeOwned;
use toml::{Table, Value};

use crate::exit::Failure;

/// `x,y,z` in millimetres.
pub(crate) fn triple(text: &str) -> Result<[f64; 3], String> {
    let parts: Vec<f64> = text
        .split(',')
        .map(|p| p.trim().parse::<f64>())
        .collect::<Result<_, _>>()
        .map_err(|e| format!("`{text}`: {e}; write x,y,z"))?;
    let parts: [f64; 3] = parts.try_into().map_err(|_| format!("`{text}`: write three numbers, x,y,z"))?;
    if parts.iter().all(|p| p.is_finite()) { Ok(parts) } else { Err(format!("`{text}`: must be finite")) }
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

/// `X,Y,Z` voxels.
pub(crate) fn dims(text: &str) -> Result<[usize; 3], String> {
    let parts: Vec<usize> = text
        .split([',', 'x'])
        .map(|p| p.trim().parse::<usize>())
        .collect::<Result<_, _>>()
        .map_err(|e| format!("`{text}`: {e}; write X,Y,Z"))?;
    parts.try_into().map_err(|_| format!("`{text}`: write three counts, X,Y,Z"))
}

/// `WxH` pixels.
pub(crate) fn size(text: &str) -> Result<[usize; 2], String> {
    let (w, h) = text.split_once(['x', ',']).ok_or_else(|| format!("`{text}`: write WxH"))?;
    let side = |t: &str| match t.trim().parse::<usize>() {
        Ok(n) if (1..=16384).contains(&n) => Ok(n),
        _ => Err(format!("`{text}`: each side 1…16384 pixels")),
    };
    Ok([side(w)?, side(h)?])
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

/// `pick=x,y,z;move=dx,dy,dz;radius=r`, or `vertex=N`, or `force=x,y,z` (mN).
pub(crate) fn handle(text: &str) -> Result<HandleSection, String> {
    let mut handle =
        HandleSection { pick: None, vertex: None, displace: None, force: None, radius: f64::NAN };
    for (key, value) in fields(text)? {
        match key {
            "pick" => handle.pick = Some(triple(value)?),
            "vertex" => handle.vertex = Some(value.parse().map_err(|e| format!("vertex `{value}`: {e}"))?),
            "move" => handle.displace = Some(triple(value)?),
            "force" => handle.force = Some(triple(value)?),
            "radius" => handle.radius = value.parse().map_err(|e| format!("radius `{value}`: {e}"))?,
            _ => {
                return Err(format!(
                    "unknown key `{key}`; a handle has pick or vertex, move or force, radius"
                ));
            }
        }
    }
    if handle.radius.is_nan() {
        return Err("the radius is missing or no number; add radius=r (mm)".to_owned());
    }
    handle.check()?;
    Ok(handle)
}

/// `pick=x,y,z;radius=r`.
pub(crate) fn fix(text: &str) -> Result<FixSection, String> {
    let (mut pick, mut radius) = (None, None);
    for (key, value) in fields(text)? {
        match key {
            "pick" => pick = Some(triple(value)?),
            "radius" => radius = Some(value.parse::<f64>().map_err(|e| format!("radius `{value}`: {e}"))?),
            _ => return Err(format!("unknown key `{key}`; a fix has pick and radius")),
        }
    }
    match (pick, radius) {
        (Some(pick), Some(radius)) if radius > 0.0 && radius.is_finite() => Ok(FixSection { pick, radius }),
        _ => Err(format!("`{text}`: write pick=x,y,z;radius=r with a positive radius in mm")),
    }
}

fn fields(text: &str) -> Result<Vec<(&str, &str)>, String> {
    text.split(';')
        .filter(|part| !part.trim().is_empty())
        .map(|part| {
            let (key, value) = part.split_once('=').ok_or_else(|| format!("`{part}`: write key=value"))?;
            Ok((key.trim(), value.trim()))
        })
        .collect()
}

/// A section of the scene from `--params FILE` with the command line's own words on top, checked as a scene's is.
pub(crate) fn section<T: DeserializeOwned>(params: Option<&Path>, words: Table) -> anyhow::Result<T> {
    let mut table = match params {
        None => Table::new(),
        Some(file) => {
            let text = std::fs::read_to_string(file)
                .map_err(|e| Failure::of(ivd_core::Fault::Io, format!("reading {}: {e}", file.display())))?;
            text.parse::<Table>().map_err(|e| Failure::usage(format!("--params {}: {e}", file.display())))?
        }
    };
    table.extend(words);
    Value::Table(table).try_into().map_err(|e: toml::de::Error| {
        let place = params
            .map_or_else(String::new, |file| format!("--params {} or the command line: ", file.display()));
        Failure::usage(format!("{place}{}", e.to_string().trim()))
    })
}

/// Collects the words that were given.
#[derive(Debug, Default)]
pub(crate) struct Words(pub(crate) Table);

impl Words {
    /// Adds a word where it was given.
    #[must_use]
    pub(crate) fn with(mut self, key: &str, value: Option<impl Into<Value>>) -> Self {
        if let Some(value) = value {
            self.0.insert(key.to_owned(), value.into());
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn handles_are_read_whole_or_refused_by_key() {
        let h = handle("pick=1,2,3; move=0,4,0; radius=25").unwrap();
        assert_eq!((h.pick, h.displace, h.radius), (Some([1.0, 2.0, 3.0]), Some([0.0, 4.0, 0.0]), 25.0));
        assert!(handle("pick=1,2,3;radius=5").unwrap_err().contains("move"));
        assert!(handle("pick=1,2;move=0,0,1;radius=5").unwrap_err().contains("three"));
        assert!(handle("pick=1,2,3;move=0,0,1;radius=-5").unwrap_err().contains("radius"));
        assert!(handle("pick=1,2,3;push=0,0,1;radius=5").unwrap_err().contains("push"));
        assert!(handle("pick=1,2,nan;move=0,0,1;radius=5").is_err());
    }

    #[test]
    fn sizes_have_units() {
        assert_eq!(bytes("2GiB"), Ok(2 << 30));
        assert_eq!(bytes("1.5k"), Ok(1536));
        assert_eq!(bytes("10MB"), Ok(10_000_000));
        assert!(bytes("10 parsecs").is_err());
        assert_eq!(size("640x480"), Ok([640, 480]));
        assert!(size("0x480").is_err());
    }
}
