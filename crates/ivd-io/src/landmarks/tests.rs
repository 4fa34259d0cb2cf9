use ivd_core::{Classified, ErrorClass};

use super::*;

/// A file with this ending and text.
fn saved(ending: &str, text: impl AsRef<[u8]>) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(format!("points.{ending}"));
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

fn point(label: &str, position: [f64; 3]) -> Landmark {
    Landmark { label: label.to_owned(), position: World(position.into()) }
}

/// What is said of a file that must be refused.
fn refused(ending: &str, text: impl AsRef<[u8]>) -> String {
    let (_folder, path) = saved(ending, text);
    let error = read(&path).unwrap_err();
    assert_eq!(error.error_class(), ErrorClass::Input, "{error}");
    error.to_string()
}

/// As 3D Slicer 5.6 saves a list of points, but for the display's properties.
fn markups(system: &str, units: &str) -> String {
    format!(
        r#"{{"@schema": "https://raw.githubusercontent.com/slicer/slicer/master/Modules/Loadable/Markups/Resources/Schema/markups-schema-v1.0.3.json#",
        "markups": [
          {{"type": "Fiducial", {system} {units} "locked": false, "labelFormat": "%N-%d", "controlPoints": [
            {{"id": "1", "label": "nasion", "description": "", "associatedNodeID": "", "position": [1.5, -80.25, 20.0],
              "orientation": [-1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0], "selected": true, "locked": false,
              "visibility": true, "positionStatus": "defined"}},
            {{"id": "2", "label": "inion", "position": [0, 0, 0], "positionStatus": "undefined"}},
            {{"id": "3", "label": "left ear, outside", "position": [70, 0, -3]}}]}},
          {{"type": "Line", "coordinateSystem": "RAS", "controlPoints": [
            {{"position": [1.0, 2.0, 3.0]}}, {{"label": "lost"}}, {{"label": "new", "position": [9, 9, 9], "positionStatus": "preview"}}]}}]}}"#
    )
}

#[test]
fn markups_come_in_ras_millimetres_whatever_their_system_and_unit() {
    let other = point("", [1.0, 2.0, 3.0]);
    let flipped = [[-1.5, 80.25, 20.0], [-70.0, 0.0, -3.0]];
    let plain = [[1.5, -80.25, 20.0], [70.0, 0.0, -3.0]];
    for (system, positions) in [
        (r#""coordinateSystem": "LPS","#, flipped),
        (r#""coordinateSystem": 1,"#, flipped),
        (r#""coordinateSystem": "1","#, flipped),
        ("", flipped),
        (r#""coordinateSystem": "RAS","#, plain),
        (r#""coordinateSystem": 0,"#, plain),
    ] {
        for (units, mm) in [
            ("", 1.0),
            (r#""coordinateUnits": "mm","#, 1.0),
            (r#""coordinateUnits": ["mm", "UCUM", "millimeter"],"#, 1.0),
            (r#""coordinateUnits": "um","#, 1e-3),
        ] {
            let (_folder, path) = saved("mrk.json", markups(system, units));
            let read = read(&path).unwrap();
            let [a, b] = positions.map(|p| p.map(|c| c * mm));
            let expected = vec![point("nasion", a), point("left ear, outside", b), other.clone()];
            assert_eq!(read, Landmarks { points: expected, unplaced: 3 }, "{system} {units}");
        }
    }
}

#[test]
fn tables_come_in_ras_millimetres_whatever_their_system() {
    for (word, sign) in [("RAS", 1.0), ("0", 1.0), ("LPS", -1.0), ("1", -1.0)] {
        let text = format!(
            "# Markups fiducial file version = 4.11\r\n# CoordinateSystem = {word}\r\n\
             # columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID\r\n\
             vtkMRMLMarkupsFiducialNode_0,1.5,-80.25,20,0,0,0,1,1,1,0,nasion,,\r\n\r\n\
             2,7e1,-0.5,-3,0,0,0,1,1,1,0,\"left \"\"ear\"\", outside\",\"a, b\",\r\n3,1,2,3"
        );
        let (_folder, path) = saved("fcsv", text);
        let expected = vec![
            point("nasion", [sign * 1.5, sign * -80.25, 20.0]),
            point("left \"ear\", outside", [sign * 70.0, sign * -0.5, -3.0]),
            point("", [sign, sign * 2.0, 3.0]),
        ];
        assert_eq!(read(&path).unwrap(), Landmarks { points: expected, unplaced: 0 }, "{word}");
    }
}

#[test]
fn columns_are_taken_by_their_names() {
    let (_folder, path) =
        saved("FCSV", "# columns = label,x,y,z,sel,vis\n# CoordinateSystem = 0\nchin,1,2,3,1,1\n");
    assert_eq!(read(&path).unwrap().points, [point("chin", [1.0, 2.0, 3.0])]);
    assert!(refused("fcsv", "# columns = label,x,y\n").contains("line 1: the columns x, y and z"));
}

#[test]
fn a_label_names_one_point_or_the_error_says_which_there_are() {
    let text = "# CoordinateSystem = RAS\n1,1,2,3,0,0,0,1,1,1,0,a\n2,4,5,6,0,0,0,1,1,1,0,b\n3,7,8,9,0,0,0,1,1,1,0,b\n";
    let landmarks = read_bytes(Format::Fcsv, text.as_bytes()).unwrap();
    assert_eq!(landmarks.named("a").unwrap(), &point("a", [1.0, 2.0, 3.0]));
    assert_eq!(landmarks.named("b"), Err(LabelError::Ambiguous { label: "b".into(), count: 2 }));
    let unknown = landmarks.named("A").unwrap_err();
    assert_eq!(unknown.error_class(), ErrorClass::Usage);
    assert_eq!(unknown.to_string(), "no landmark is labelled `A`; there are `a`, `b`, `b`");
    let many = (0..40).map(|i| format!("{i},1,2,3,0,0,0,1,1,1,0,p{i}")).collect::<Vec<_>>().join("\n");
    let many = read_bytes(Format::Fcsv, format!("#CoordinateSystem=LPS\n{many}").as_bytes()).unwrap();
    assert!(many.named("q").unwrap_err().to_string().ends_with("`p11` and 28 more"));
}

#[test]
fn what_cannot_be_used_is_refused_with_its_place() {
    let one = |inside: &str| format!(r#"{{"markups": [{{{inside}}}]}}"#);
    for (text, said) in [
        ("{".to_owned(), "line 1: no JSON"),
        ("[]".to_owned(), "markups: the list is missing"),
        (r#"{"markups": 3}"#.to_owned(), "markups: the list is missing"),
        (r#"{"markups": []}"#.to_owned(), "no control point"),
        (one(r#""controlPoints": []"#), "no control point"),
        (one(r#""controlPoints": {}"#), "markups[0].controlPoints: not a list"),
        (one(r#""controlPoints": [7]"#), "none of its 1 control points is placed"),
        (
            one(r#""controlPoints": [{"positionStatus": "undefined", "position": [1, 2, 3]}]"#),
            "none of its 1",
        ),
        (one(r#""controlPoints": [{"positionStatus": 3}]"#), "controlPoints[0].positionStatus"),
        (one(r#""controlPoints": [{"position": [1, 2]}]"#), "controlPoints[0].position: not three numbers"),
        (one(r#""controlPoints": [{"position": [1, 2, "3"]}]"#), "controlPoints[0].position: not three"),
        (one(r#""controlPoints": [{"position": [1, 2, NaN]}]"#), "line 1: no JSON"),
        (one(r#""controlPoints": [{"position": [1, 2, 1e999]}]"#), "line 1: no JSON"),
        (one(r#""coordinateSystem": "IJK""#), "markups[0].coordinateSystem: the coordinate system `IJK`"),
        (one(r#""coordinateSystem": 2"#), "the coordinate system `2` is not known; save the points in RAS"),
        (one(r#""coordinateUnits": "inch""#), "markups[0].coordinateUnits: the unit"),
        (one(r#""coordinateUnits": []"#), "markups[0].coordinateUnits: the unit"),
    ] {
        let told = refused("mrk.json", &text);
        assert!(told.contains(said), "{text}: {told}");
    }
    for (text, said) in [
        ("", "no control point"),
        ("# CoordinateSystem = RAS\n", "no control point"),
        ("# CoordinateSystem = MNI\n", "line 1: the coordinate system `MNI`"),
        ("# CoordinateSystem = \n", "line 1: the coordinate system ``"),
        ("1,2,3,4\n", "line 1: no line above says"),
        ("#CoordinateSystem=RAS\n1,2,3\n", "line 2: z is missing"),
        ("#CoordinateSystem=RAS\n1,2,b,3\n", "line 2: y: `b` is no number"),
        ("#CoordinateSystem=RAS\n1,2,inf,3\n", "line 2: the position [2.0, inf, 3.0] is not finite"),
        ("#CoordinateSystem=RAS\n1,nan,1,3\n", "is not finite"),
        ("#CoordinateSystem=RAS\n\"1,2,3,4\n", "line 2: x is missing"),
    ] {
        let told = refused("fcsv", text);
        assert!(told.contains(said), "{text}: {told}");
    }
    assert!(refused("csv", "").contains("give a .mrk.json or .fcsv"));
    assert_eq!(read(Path::new("nowhere.fcsv")).unwrap_err().error_class(), ErrorClass::Io);
    let folder = tempfile::tempdir().unwrap();
    let inside = folder.path().join("a.fcsv");
    std::fs::create_dir(&inside).unwrap();
    assert!(read(&inside).unwrap_err().to_string().contains("regular file"));
}

#[test]
fn sizes_are_bounded() {
    assert!(
        refused("mrk.json", vec![b' '; MAX_BYTES as usize + 1])
            .contains(&format!("more than {MAX_BYTES} bytes"))
    );
    let lines = "1,2,3,4\n".repeat(MAX_POINTS);
    let told = |lines: &str| read_bytes(Format::Fcsv, format!("#CoordinateSystem=RAS\n{lines}").as_bytes());
    assert_eq!(told(&lines).unwrap().points.len(), MAX_POINTS);
    let more = told(&(lines + "1,2,3,4\n")).unwrap_err().to_string();
    assert!(more.contains("line 100002: more than 100000 points"), "{more}");
    assert!(refused("mrk.json", "[".repeat(1 << 20)).contains("no JSON"), "depth is bounded");
}

#[test]
fn damaged_bytes_give_points_that_are_finite_or_an_error() {
    let table = "# CoordinateSystem = LPS\n# columns = id,x,y,z,label\n1,2.5,-3,4e3,\"a\"\n2,1,2,3,b\n";
    let files = [(Format::Fcsv, table.to_owned()), (Format::Markups, markups("", ""))];
    for (format, text) in files {
        let sound = text.as_bytes();
        for at in 0..sound.len() {
            for byte in [0, b'"', b',', b'\n', b'9', b'e', b'{', 0xff] {
                let mut bad = sound.to_vec();
                bad[at] = byte;
                for bytes in [&bad[..], &bad[..at], &bad[at..]] {
                    if let Ok(read) = read_bytes(format, bytes) {
                        assert!(!read.points.is_empty());
                        assert!(read.points.iter().all(|p| p.position.0.iter().all(|c| c.is_finite())));
                    }
                }
            }
        }
    }
}
