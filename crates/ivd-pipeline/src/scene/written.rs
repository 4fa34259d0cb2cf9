//! Handles, fixed places, bones, and shapes in one line, as a command line gives them.

use std::str::FromStr;

use super::{FixSection, HandleSection, RigidSection, ShapeSection};

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

impl FromStr for HandleSection {
    type Err = String;

    /// Reads `pick=x,y,z;move=dx,dy,dz;radius=r`, or with `vertex=N`, or with `force=x,y,z` (mN).
    fn from_str(text: &str) -> Result<Self, String> {
        let mut handle = Self { pick: None, vertex: None, displace: None, force: None, radius: f64::NAN };
        for (key, value) in fields(text)? {
            match key {
                "pick" => handle.pick = Some(triple(value)?),
                "vertex" => {
                    handle.vertex = Some(value.parse().map_err(|e| format!("vertex `{value}`: {e}"))?);
                }
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

impl FromStr for ShapeSection {
    type Err = String;

    /// Reads the keys of a `[[deform.shape]]` as `key=value`, vectors as `x,y,z`: `kind=twist;centre=x,y,z;radius=r;rate=a`.
    fn from_str(text: &str) -> Result<Self, String> {
        let mut keys = toml::Table::new();
        for (key, value) in fields(text)? {
            let number =
                || value.parse::<f64>().map(toml::Value::Float).map_err(|e| format!("{key} `{value}`: {e}"));
            let value = match key {
                "kind" => value.into(),
                "centre" | "axis" | "by" | "spine" => {
                    triple(value).map_err(|e| format!("{key}: {e}"))?.to_vec().into()
                }
                _ => number()?,
            };
            if keys.insert(key.to_owned(), value).is_some() {
                return Err(format!("`{key}` is there twice; give it once"));
            }
        }
        let shape: Self = keys.try_into().map_err(|e: toml::de::Error| e.message().to_owned())?;
        shape.shape()?;
        Ok(shape)
    }
}

impl FromStr for RigidSection {
    type Err = String;

    /// Reads the keys of a `[[deform.rigid]]` as `key=value`, vectors as `x,y,z`: `name=a;class=4;pivot=x,y,z;angle=6;reach=r`.
    fn from_str(text: &str) -> Result<Self, String> {
        let mut keys = toml::Table::new();
        for (key, value) in fields(text)? {
            let vector =
                || triple(value).map(|v| toml::Value::from(v.to_vec())).map_err(|e| format!("{key}: {e}"));
            let wrong = |e: &dyn std::fmt::Display| format!("{key} `{value}`: {e}");
            let value = match key {
                "name" | "parent" => value.into(),
                "centre" | "from" | "to" | "low" | "high" | "pivot" | "axis" | "move" => vector()?,
                "class" => value.parse::<u16>().map(|n| i64::from(n).into()).map_err(|e| wrong(&e))?,
                "fit" => value.parse::<bool>().map(toml::Value::Boolean).map_err(|e| wrong(&e))?,
                _ => value.parse::<f64>().map(toml::Value::Float).map_err(|e| wrong(&e))?,
            };
            if keys.insert(key.to_owned(), value).is_some() {
                return Err(format!("`{key}` is there twice; give it once"));
            }
        }
        let bone: Self = keys.try_into().map_err(|e: toml::de::Error| e.message().to_owned())?;
        bone.part(0)?;
        Ok(bone)
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
    fn handles_are_read_whole_or_refused_by_key() {
        let handle = |text: &str| text.parse::<HandleSection>();
        let h = handle("pick=1,2,3; move=0,4,0; radius=25").unwrap();
        assert_eq!((h.pick, h.displace, h.radius), (Some([1.0, 2.0, 3.0]), Some([0.0, 4.0, 0.0]), 25.0));
        assert!(handle("pick=1,2,3;radius=5").unwrap_err().contains("move"));
        assert!(handle("pick=1,2;move=0,0,1;radius=5").unwrap_err().contains("three"));
        assert!(handle("pick=1,2,3;move=0,0,1;radius=-5").unwrap_err().contains("radius"));
        assert!(handle("pick=1,2,3;push=0,0,1;radius=5").unwrap_err().contains("push"));
        assert!(handle("pick=1,2,nan;move=0,0,1;radius=5").is_err());
    }

    #[test]
    fn fixed_places_need_a_positive_radius() {
        let fix = |text: &str| text.parse::<FixSection>();
        assert_eq!(fix("pick=1,2,3;radius=4"), Ok(FixSection { pick: [1.0, 2.0, 3.0], radius: 4.0 }));
        assert!(fix("pick=1,2,3;radius=0").unwrap_err().contains("positive"));
        assert!(fix("pick=1,2,3;radius=nan").is_err());
    }

    #[test]
    fn bones_are_read_as_in_a_scene_or_refused_by_key() {
        let bone = |text: &str| text.parse::<RigidSection>();
        let written = bone(
            "name=C5;parent=C6;low=0,0,40;high=64,64,48;class=4;pivot=32,28,38;axis=1,0,0;angle=-6;reach=30",
        );
        let scene = "name = \"C5\"\nparent = \"C6\"\nlow = [0, 0, 40]\nhigh = [64, 64, 48]\nclass = 4\n\
            pivot = [32, 28, 38]\naxis = [1, 0, 0]\nangle = -6\nreach = 30";
        assert_eq!(written.unwrap(), toml::from_str(scene).unwrap());
        assert!(bone("centre=1,2,3;radius=4;fit=true;reach=5").unwrap().fit);
        for (text, word) in [
            ("centre=1,2,3;radius=4", "reach"),
            ("centre=1,2;radius=4;reach=5", "centre"),
            ("class=bone;reach=5", "class"),
            ("class=4;fit=yes;reach=5", "fit"),
            ("class=4;reach=5;reach=6", "twice"),
            ("class=4;reach=5;colour=6", "colour"),
            ("class=4;angle=5;reach=5", "pivot"),
        ] {
            let error = bone(text).unwrap_err();
            assert!(error.contains(word), "{text}: {error}");
        }
    }

    #[test]
    fn shapes_are_read_as_in_a_scene_or_refused_by_key() {
        let shape = |text: &str| text.parse::<ShapeSection>();
        let twist = shape("kind=twist; centre=1,2,3; axis=0,1,0; radius=30; rate=2.5; length=20").unwrap();
        let scene =
            "kind = \"twist\"\ncentre = [1, 2, 3]\naxis = [0, 1, 0]\nradius = 30\nrate = 2.5\nlength = 20";
        assert_eq!(twist, toml::from_str(scene).unwrap());
        let refused = [
            ("kind=twirl;centre=1,2,3;radius=3", "twirl"),
            ("kind=twist;centre=1,2,3;rate=1", "radius"),
            ("kind=twist;centre=1,2;radius=3;rate=1", "centre"),
            ("kind=twist;centre=1,2,3;radius=3;rate=x", "rate"),
            ("kind=twist;centre=1,2,3;radius=3;rate=1;rate=2", "twice"),
            ("kind=twist;centre=1,2,3;radius=3;rate=1;angle=2", "angle"),
            ("kind=twist;centre=1,2,3;radius=3;rate=1;size=2", "size"),
        ];
        for (text, word) in refused {
            let error = shape(text).unwrap_err();
            assert!(error.contains(word), "{text}: {error}");
        }
    }
}
