use ivd_pipeline::list::STAGES;

use super::*;

fn point(knob: &str, seconds: f64, counted: Option<f64>, error: f64) -> FrontPoint {
    let time = Spread { least: 0.9 * seconds, median: seconds, most: 1.1 * seconds };
    FrontPoint {
        task: String::new(),
        knobs: [("step".to_owned(), knob.to_owned())].into(),
        default: knob == "1",
        cpu_s: time,
        wall_s: time,
        counted,
        error,
        error_voxels: None,
        counters: BTreeMap::new(),
    }
}

fn front(points: Vec<FrontPoint>) -> Front {
    let word = str::to_owned;
    Front {
        schema: 1,
        stage: word("render"),
        input: word("a ball"),
        truth: word("a short step"),
        measure: word("difference"),
        unit: word("of 1"),
        counted: points[0].counted.map(|_| word("samples")),
        voxel_mm: None,
        work: Work { what: word("pixels"), amount: 100.0 },
        threads: 2,
        repeats: 7,
        points,
    }
}

fn default(front: &Front) -> Result<(), String> {
    front.check_default("", &[("step".to_owned(), "1".to_owned())].into())
}

#[test]
fn a_default_that_another_setting_beats_is_refused() {
    let fair = vec![point("1", 1.0, Some(10.0), 0.5), point("2", 0.5, Some(5.0), 1.0)];
    assert_eq!(default(&front(fair.clone())), Ok(()));
    // The same work and less error, less work and the same error, less of both.
    for better in
        [point("3", 1.0, Some(10.0), 0.4), point("3", 1.0, Some(9.0), 0.5), point("3", 0.5, Some(9.0), 0.4)]
    {
        let told = default(&front([fair.clone(), vec![better]].concat())).unwrap_err();
        assert!(told.contains("is beaten by step 3"), "{told}");
    }
    let dearer = point("3", 0.1, Some(11.0), 0.4);
    assert_eq!(default(&front([fair, vec![dearer]].concat())), Ok(()), "counted work goes before time");
}

#[test]
fn times_beat_only_beyond_their_spread() {
    let with = |seconds, error| front(vec![point("1", 1.0, None, 0.5), point("3", seconds, None, error)]);
    assert_eq!(default(&with(0.9, 0.4)), Ok(()), "the spreads overlap");
    assert!(default(&with(0.7, 0.4)).unwrap_err().contains("beaten"));
    assert_eq!(default(&with(0.7, 0.6)), Ok(()));
}

#[test]
fn points_of_another_task_beat_nothing() {
    let mut other = point("3", 0.1, Some(1.0), 0.1);
    other.task = "level 2".to_owned();
    assert_eq!(default(&front(vec![point("1", 1.0, Some(10.0), 0.5), other])), Ok(()));
}

#[test]
fn a_default_that_is_not_the_recorded_one_asks_for_a_new_record() {
    let record = front(vec![point("2", 1.0, None, 0.5)]);
    assert!(default(&record).unwrap_err().contains("record again"));
    let mut unmarked = front(vec![point("1", 1.0, None, 0.5)]);
    unmarked.points[0].default = false;
    assert!(default(&unmarked).unwrap_err().contains("record again"));
}

#[test]
fn the_record_is_of_this_layout_and_wide() {
    for front in recorded().unwrap() {
        let name = &front.stage;
        assert_eq!(front.schema, 1, "{name}");
        assert!(front.work.amount > 0.0 && !front.work.what.is_empty(), "{name}");
        assert!(front.points.iter().all(|p| p.error.is_finite() && p.cost() > 0.0), "{name}");
        assert!(front.points.iter().all(|p| p.counted.is_some() == front.counted.is_some()), "{name}");
        let mut pairs: Vec<(f64, f64)> = front.points.iter().map(|p| (p.cost(), p.error)).collect();
        pairs.sort_by(|a, b| a.partial_cmp(b).unwrap());
        let by_cost = pairs.iter().map(|p| p.0.to_bits()).collect::<std::collections::BTreeSet<_>>().len();
        let by_error = pairs.iter().map(|p| p.1.to_bits()).collect::<std::collections::BTreeSet<_>>().len();
        assert!(by_cost >= 5 && by_error >= 5, "{name}: {by_cost} costs, {by_error} errors");
    }
    let rates = recorded_rates().unwrap();
    // The plain scene's classes come from no tree, and it has none of the stages that few scenes have.
    let usual = STAGES.iter().filter(|stage| !stage.quiet);
    let all = usual.flat_map(|stage| stage.places.iter().map(|place| (stage.name, place.variant)));
    for (stage, variant) in all.chain([("import", "")]).filter(|place| *place != ("segment", "tree")) {
        let rate = crate::rate_name(stage, variant);
        assert!(rates.seconds(&rate, 1.0) > 0.0, "{rate}");
    }
}
