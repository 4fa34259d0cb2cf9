use ivd_core::{Classified, ErrorClass};

use super::*;

fn transfer() -> TransferFunction {
    let row =
        |shift: f32| (0..64).map(move |i| [i as f32 / 63.0, shift, 0.5, if i > 40 { 0.8 } else { 0.0 }]);
    let table = row(0.1).chain(row(0.9)).collect();
    TransferFunction::new([-100.0, 300.0], 64, 2.5, vec![0, 3], table, Vec::new()).unwrap()
}

#[test]
fn what_is_written_is_read_back() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["t.json", "t.vp.json", "t.paraview.json"] {
        let path = folder.path().join(name);
        let format = Format::of(&path).unwrap();
        assert!(write(&path, &transfer(), format).unwrap() && !write(&path, &transfer(), format).unwrap());
        let back = read(&path).unwrap();
        assert_eq!((back.range(), back.reference_mm()), ([-100.0, 300.0], 2.5), "{name}");
        if format == Format::Own {
            assert_eq!(back, transfer());
        }
        for i in 0..500 {
            let value = -120.0 + f64::from(i);
            let (a, b) = (back.sample(0, value), transfer().sample(0, value));
            // Beside a step of the opacity a sample of the other table lies to one side of it.
            let is_step = (155.0..165.0).contains(&value);
            assert!(
                a.iter().zip(b).all(|(a, b)| is_step || (a - b).abs() < 4e-3),
                "{name} {value}: {a:?} {b:?}"
            );
        }
    }
    assert_eq!(Format::of(Path::new("t.png")), None);
}

#[test]
fn a_table_by_gradient_is_kept_by_our_own_format_and_refused_by_others() {
    let table = (0..12).map(|i| [0.1 * i as f32 / 2.0, 0.5, 0.25, 0.5]).collect();
    let steep = transfer().with_gradient(ivd_core::GradientTable::new(7.5, [4, 3], table).unwrap());
    let folder = tempfile::tempdir().unwrap();
    let own = folder.path().join("t.json");
    write(&own, &steep, Format::Own).unwrap();
    assert_eq!(read(&own).unwrap(), steep);
    for name in ["t.vp.json", "t.paraview.json"] {
        let path = folder.path().join(name);
        let error = write(&path, &steep, Format::of(&path).unwrap()).unwrap_err();
        assert_eq!(error.error_class(), ErrorClass::Usage);
        let told = error.to_string();
        assert!(told.contains(name) && told.contains("gradient") && told.contains("axes value"), "{told}");
        assert!(!path.exists());
    }
}

#[test]
fn files_that_hold_none_are_refused_with_the_place() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |text: &str, place: &str| {
        let path = folder.path().join("t.json");
        std::fs::write(&path, text).unwrap();
        let error = read(&path).unwrap_err();
        assert_eq!(error.error_class(), ErrorClass::Input, "{error}");
        assert!(error.to_string().contains(place), "{error}");
    };
    refused("{", "line 1");
    refused("{}", "the file");
    refused(r#"{"volumeProperties": []}"#, "volumeProperties");
    let component = r#"{"volumeProperties": [{"components": [{"rgbTransferFunction": {"points": [{"x": 1, "color": [0, 1]}]},
        "scalarOpacity": {"points": []}}]}]}"#;
    refused(component, "rgbTransferFunction.points[0]");
    refused(r#"[{"RGBPoints": [0, 0, 0]}]"#, "RGBPoints");
    refused(r#"[{"RGBPoints": [0, 0, 0, 1], "ColorSpace": "Lab"}]"#, "ColorSpace");
    refused(
        r#"{"table": [[0, 0, 0, 2]], "classes": [0], "entries": [], "range": [0, 1], "resolution": 1, "reference_mm": 1}"#,
        "the table",
    );
    assert_eq!(read(Path::new("nowhere.json")).unwrap_err().error_class(), ErrorClass::Io);
}

#[test]
fn presets_are_read() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/transfer"));
    let mut count = 0;
    for file in std::fs::read_dir(folder).unwrap() {
        let path = file.unwrap().path();
        let preset = read(&path).unwrap();
        assert_eq!(preset.range()[0], -1000.0, "{}", path.display());
        assert_eq!(preset.sample(0, -1000.0)[3], 0.0, "{}: air is clear", path.display());
        assert!(preset.sample(0, 1500.0)[3] > 0.5, "{}: bone is seen", path.display());
        count += 1;
    }
    assert!(count >= 4);
}
