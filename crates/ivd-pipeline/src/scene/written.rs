//! Places in one line, as a command line gives them.

use std::str::FromStr;

use super::FixSection;

/// Reads `x,y,z`, three finite numbers.
///
/// # Errors
/// A sentence with what was written and what to write.
pub fn triple(text: &str) -> Result<[f64; 3], String> {
    let parts: Vec<f64> = text
        .split(',')
        .map(|p| p.trim().parse::<f64>())
        .collect::<Result<_, _>>()
        .map_err(|e| format!("`{text}`: {e}; write x,y,z"))?;
    let parts: [f64; 3] = parts.try_into().map_err(|_| format!("`{text}`: write three numbers, x,y,z"))?;
    if parts.iter().all(|p| p.is_finite()) { Ok(parts) } else { Err(format!("`{text}`: must be finite")) }
}

impl FromStr for FixSection {
    type Err = String;

    /// Reads `pick=x,y,z;radius=r`.
    fn from_str(text: &str) -> Result<Self, String> {
        let (mut pick, mut radius) = (None, None);
        for (key, value) in fields(text)? {
            match key {
                "pick" => pick = Some(triple(value)?),
                "radius" => {
                    radius = Some(value.parse::<f64>().map_err(|e| format!("radius `{value}`: {e}"))?);
                }
                _ => return Err(format!("unknown key `{key}`; a fix has pick and radius")),
            }
        }
        match (pick, radius) {
            (Some(pick), Some(radius)) if radius > 0.0 && radius.is_finite() => Ok(Self { pick, radius }),
            _ => Err(format!("`{text}`: write pick=x,y,z;radius=r with a positive radius in mm")),
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fixed_places_need_a_positive_radius() {
        let fix = |text: &str| text.parse::<FixSection>();
        assert_eq!(fix("pick=1,2,3;radius=4"), Ok(FixSection { pick: [1.0, 2.0, 3.0], radius: 4.0 }));
        assert!(fix("pick=1,2,3;radius=0").unwrap_err().contains("positive"));
        assert!(fix("pick=1,2,3;radius=nan").is_err());
    }
}
