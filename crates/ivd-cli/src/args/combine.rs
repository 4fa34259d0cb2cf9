//! What `ivd combine` and `ivd clip` take.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use ivd_field::clip::{Cuboid, HalfSpace};
use ivd_field::combine::Op;
use ivd_pipeline::scene::triple;

use super::output::Output;
use crate::parse;

/// Arguments of `ivd combine`.
#[derive(Debug, Args)]
pub(crate) struct CombineArgs {
    /// Two to eight operands: volumes (artefacts or files), labels or masks (artefacts). The result has the first one's kind and lies on the first
    /// one's grid; others are read there by world position.
    #[arg(required = true, num_args = 2..=8, value_name = "OPERAND")]
    pub(crate) operands: Vec<PathBuf>,
    /// What any operand fills, what all of them fill, or what the first fills and none of the others.
    #[arg(long, value_enum)]
    pub(crate) op: OpChoice,
    /// Values between which a volume's opacity rises from 0 to 1: once for all operands, or once for each in their order. Each
    /// volume's own range without it.
    #[arg(long, value_name = "LO,HI", value_parser = parse::interval, allow_hyphen_values = true)]
    pub(crate) window: Vec<[f64; 2]>,
    /// Read operand N, counted from 1, through this displacement (artefact): as `ivd warp` would deform it.
    #[arg(long, value_name = "N=FILE", value_parser = numbered)]
    pub(crate) displacement: Vec<(usize, PathBuf)>,
    #[command(flatten)]
    pub(crate) output: Output,
}

/// How operands are put together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum OpChoice {
    /// The largest opacity.
    Union,
    /// The smallest opacity.
    Intersection,
    /// The first one's opacity, where the others leave room for it.
    Difference,
}

impl From<OpChoice> for Op {
    fn from(choice: OpChoice) -> Self {
        match choice {
            OpChoice::Union => Self::Union,
            OpChoice::Intersection => Self::Intersection,
            OpChoice::Difference => Self::Difference,
        }
    }
}

/// Arguments of `ivd clip`.
#[derive(Debug, Args)]
pub(crate) struct ClipArgs {
    /// Volume artefact or file, labels artefact, or mask artefact.
    pub(crate) volume: PathBuf,
    /// 'point=x,y,z;normal=x,y,z' (mm): keep the voxels whose centres lie on the side that the normal points to, or on the plane. A lattice of
    /// what is kept ends between voxels: up to a voxel from the plane, in steps if the plane is oblique.
    #[arg(long, value_name = "PLANE", value_parser = plane)]
    pub(crate) plane: Vec<HalfSpace>,
    /// 'min=x,y,z;max=x,y,z' (mm): keep the voxels whose centres lie in a box along the world axes, or on its faces.
    #[arg(long = "box", value_name = "BOX", value_parser = cuboid)]
    pub(crate) boxes: Vec<Cuboid>,
    /// Keep the voxels that a mask or labels (artefact) tag; on another grid the nearest voxel counts. Join several with
    /// `ivd combine`.
    #[arg(long, value_name = "MASK|LABELS")]
    pub(crate) tag: Option<PathBuf>,
    /// Of labels that tag: this class alone; without it every label but 0.
    #[arg(long, value_name = "N", requires = "tag")]
    pub(crate) class: Option<u16>,
    /// Throw away what planes, boxes and tag together would keep, and keep the rest.
    #[arg(long)]
    pub(crate) invert: bool,
    /// Value of what is thrown away; the smallest one without it, 0 for labels and masks.
    #[arg(long, value_name = "VALUE", allow_hyphen_values = true)]
    pub(crate) background: Option<f64>,
    /// The displacement (artefact) that deformed the data: planes, boxes and tag are those of the body at rest. What it left
    /// behind stays background.
    #[arg(long, value_name = "FILE")]
    pub(crate) displacement: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) output: Output,
}

/// `N=FILE`, N from 1.
fn numbered(text: &str) -> Result<(usize, PathBuf), String> {
    let wrong = || format!("`{text}`: write N=FILE, N the number of an operand, counted from 1");
    let (number, file) = text.split_once('=').ok_or_else(wrong)?;
    match number.trim().parse() {
        Ok(number) if number > 0 && !file.is_empty() => Ok((number, file.into())),
        _ => Err(wrong()),
    }
}

/// `point=x,y,z;normal=x,y,z`.
fn plane(text: &str) -> Result<HalfSpace, String> {
    let [point, normal] = pair(text, ["point", "normal"])?;
    Ok(HalfSpace { point, normal })
}

/// `min=x,y,z;max=x,y,z`.
fn cuboid(text: &str) -> Result<Cuboid, String> {
    let [min, max] = pair(text, ["min", "max"])?;
    Ok(Cuboid { min, max })
}

/// Two vectors by their names, in any order.
fn pair(text: &str, names: [&str; 2]) -> Result<[[f64; 3]; 2], String> {
    let [first, second] = names;
    let wrong = |problem: String| format!("{problem}; write {first}=x,y,z;{second}=x,y,z");
    let mut found = [None; 2];
    for part in text.split(';').filter(|part| !part.trim().is_empty()) {
        let (name, value) = part.split_once('=').ok_or_else(|| wrong(format!("`{part}` has no `=`")))?;
        let name = name.trim();
        let slot = names.iter().position(|n| *n == name);
        let slot = slot.ok_or_else(|| wrong(format!("unknown key `{name}`")))?;
        let value = triple(value).map_err(|e| format!("{name}: {e}"))?;
        if found[slot].replace(value).is_some() {
            return Err(wrong(format!("`{name}` is there twice")));
        }
    }
    match found {
        [Some(a), Some(b)] => Ok([a, b]),
        [None, _] => Err(wrong(format!("`{first}` is missing"))),
        [_, None] => Err(wrong(format!("`{second}` is missing"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_and_boxes_are_read_whole_or_refused_by_key() {
        let read = plane("normal=0,-1,0.5; point=1,2,3").unwrap();
        assert_eq!(read, HalfSpace { point: [1.0, 2.0, 3.0], normal: [0.0, -1.0, 0.5] });
        let read = cuboid("min=-1,-2,-3;max=1,2,3").unwrap();
        assert_eq!(read, Cuboid { min: [-1.0, -2.0, -3.0], max: [1.0, 2.0, 3.0] });
        for (text, word) in [
            ("point=1,2,3", "`normal` is missing"),
            ("normal=1,2,3", "`point` is missing"),
            ("point=1,2;normal=0,0,1", "three numbers"),
            ("point=1,2,nan;normal=0,0,1", "finite"),
            ("point=1,2,3;point=1,2,3;normal=0,0,1", "twice"),
            ("point=1,2,3;normal=0,0,1;turn=3", "unknown key `turn`"),
            ("1,2,3", "no `=`"),
        ] {
            let error = plane(text).unwrap_err();
            assert!(error.contains(word), "{text}: {error}");
        }
    }

    #[test]
    fn displacements_name_their_operand() {
        assert_eq!(numbered("2=a=b.ivd"), Ok((2, "a=b.ivd".into())));
        for text in ["0=d.ivd", "d.ivd", "2=", "-1=d.ivd"] {
            assert!(numbered(text).unwrap_err().contains("counted from 1"), "{text}");
        }
    }
}
