//! Tables of fiducials: comments that begin with `#`, then a line for every point.

use super::{Landmarks, Problem, space};

/// The columns of a file that doesn't list them, as 3D Slicer writes them from version 4 on.
const COLUMNS: [&str; 14] =
    ["id", "x", "y", "z", "ow", "ox", "oy", "oz", "vis", "sel", "lock", "label", "desc", "associatedNodeID"];

/// Where the columns that are read stand in a line.
struct Places {
    position: [usize; 3],
    label: Option<usize>,
}

impl Places {
    fn of(columns: &[&str], place: &str) -> Result<Self, Problem> {
        let at = |name: &str| columns.iter().position(|column| column.trim() == name);
        match [at("x"), at("y"), at("z")] {
            [Some(x), Some(y), Some(z)] => Ok(Self { position: [x, y, z], label: at("label") }),
            _ => Err(Problem::new(place, "the columns x, y and z are not all there")),
        }
    }
}

pub(super) fn read(bytes: &[u8]) -> Result<Landmarks, Problem> {
    let text = String::from_utf8_lossy(bytes);
    let mut places = Places::of(&COLUMNS, "columns")?;
    let mut system = None;
    let mut landmarks = Landmarks::default();
    for (number, line) in (1_u64..).zip(text.lines()) {
        let place = format!("line {number}");
        if let Some(comment) = line.strip_prefix('#') {
            match comment.split_once('=').map(|(name, value)| (name.trim(), value.trim())) {
                Some(("CoordinateSystem", word)) => system = Some(space(word, &place)?),
                Some(("columns", list)) => {
                    places = Places::of(&list.split(',').collect::<Vec<_>>(), &place)?;
                }
                _ => {}
            }
        } else if !line.trim().is_empty() {
            let Some(system) = system else {
                let problem = Problem::new(place, "no line above says which coordinate system it is in");
                return Err(problem.with_remedy(
                    "add the line `# CoordinateSystem = RAS`, or LPS, whichever the points are in",
                ));
            };
            let fields = fields(line);
            let position = position(&fields, &places, &place)?;
            let label = places.label.and_then(|at| fields.get(at)).cloned().unwrap_or_default();
            landmarks.add(&place, label, position, (system, 1.0))?;
        }
    }
    Ok(landmarks)
}

fn position(fields: &[String], places: &Places, place: &str) -> Result<[f64; 3], Problem> {
    let mut position = [0.0; 3];
    for ((value, at), axis) in position.iter_mut().zip(places.position).zip(["x", "y", "z"]) {
        let field = fields.get(at).ok_or_else(|| Problem::new(place, format!("{axis} is missing")))?;
        *value = field.trim().parse().map_err(|_| {
            let field: String = field.chars().take(40).collect();
            Problem::new(place, format!("{axis}: `{field}` is no number"))
        })?;
    }
    Ok(position)
}

/// The fields of a line. One that begins with a quote goes to the next single quote, and two stand for one; any other quote is itself.
fn fields(line: &str) -> Vec<String> {
    let mut fields = vec![String::new()];
    let mut chars = line.chars().peekable();
    let mut quoted = false;
    while let Some(c) = chars.next() {
        let field = fields.last_mut().expect("there is a field from the start");
        match c {
            '"' if quoted && chars.peek() == Some(&'"') => {
                chars.next();
                field.push('"');
            }
            '"' if quoted => quoted = false,
            '"' if field.is_empty() => quoted = true,
            ',' if !quoted => fields.push(String::new()),
            c => field.push(c),
        }
    }
    fields
}
