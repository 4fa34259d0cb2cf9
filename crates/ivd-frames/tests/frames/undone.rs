//! What is drawn is undone and done again among the steps of the session.

use ivd_frames::{Figures, Model, Pane, Request};

use super::common::{BALL, model};

fn follow(model: &mut Model, request: &Request) -> Figures {
    model.follow(request).unwrap();
    model.figures()
}

#[test]
fn colours_and_rulers_are_undone_in_the_order_in_which_they_were_made() {
    let by_classes = BALL.replace("[lattice]\niso = 127.5\n", "[segment]\nk = 3\n");
    let mut model = model(&by_classes.replace("mode = \"iso\"\niso = 127.5\n", ""));
    let class = model.figures().classes.last().unwrap().id;
    let look = |hidden, opacity, colour: &str| Request::Class {
        class,
        hidden,
        opacity: Some(opacity),
        colour: Some(colour.to_owned()),
    };
    let colour = model.figures().classes.last().unwrap().colour.clone();
    let requests = [
        look(true, 0.5, &colour),
        Request::Add { place: [16.0, 28.0, 16.0], by: [0.0, 2.0, 0.0] },
        Request::Measure { pane: Pane::Axial, from: [0.3; 2], to: [0.6; 2] },
        look(false, 0.5, &colour),
        look(false, 0.5, "#ff0000"),
        Request::Transfer { by: [0.1, 0.0] },
        Request::Move { handle: 0, by: [0.0, 1.0, 0.0] },
        Request::Unmeasure { ruler: 0 },
    ];
    let names = [
        format!("hide class {class}"),
        "add a handle".to_owned(),
        "measure".to_owned(),
        format!("show class {class}"),
        format!("colour class {class}"),
        "shift colours".to_owned(),
        "move a handle".to_owned(),
        "remove ruler 0".to_owned(),
    ];
    let state = |told: &Figures| {
        let handles: Vec<_> = told.handles.iter().map(|one| (one.id, one.by)).collect();
        (told.classes.clone(), handles, told.rulers.clone(), told.undo.clone(), told.redo.clone())
    };
    let mut states = vec![model.figures()];
    for (request, name) in requests.iter().zip(&names) {
        states.push(follow(&mut model, request));
        assert_eq!(states.last().unwrap().undo.as_ref(), Some(name));
    }
    for n in (0..names.len()).rev() {
        let told = follow(&mut model, &Request::Undo);
        assert_eq!(told.redo.as_ref(), Some(&names[n]));
        let (classes, handles, rulers, undo, _) = state(&states[n]);
        assert_eq!(
            (told.classes.clone(), told.rulers.clone(), told.undo.clone()),
            (classes, rulers, undo),
            "{n}"
        );
        assert_eq!(state(&told).1, handles, "{n}");
    }
    for (n, then) in states.iter().enumerate().skip(1) {
        let told = follow(&mut model, &Request::Redo);
        assert_eq!(state(&told).0, state(then).0, "{n}");
        assert_eq!(
            (state(&told).1, state(&told).2, &told.undo),
            (state(then).1, state(then).2, &then.undo),
            "{n}"
        );
    }
    assert_eq!(model.figures().redo, None);
    // What is undone isn't done again once something else is.
    follow(&mut model, &Request::Undo);
    let told = follow(&mut model, &Request::Move { handle: 0, by: [0.0, 1.5, 0.0] });
    assert_eq!((told.redo, told.rulers.len()), (None, 1));
    // Nor is what the session has undone.
    follow(&mut model, &Request::Undo);
    let told = follow(&mut model, &Request::Unmeasure { ruler: 0 });
    assert_eq!((told.redo, told.undo.as_deref()), (None, Some("remove ruler 0")));
    // A drag that is given up is nothing else.
    follow(&mut model, &Request::Undo);
    follow(&mut model, &Request::Grab { pane: Pane::Volume, at: [0.5; 2] });
    follow(&mut model, &Request::Drag { to: [0.52, 0.5], lock: None });
    let told = follow(&mut model, &Request::Abandon);
    assert_eq!(told.redo.as_deref(), Some("remove ruler 0"));
    // What a window restores is how it begins.
    follow(&mut model, &Request::Unmeasure { ruler: 0 });
    let told = follow(&mut model, &Request::Restored);
    assert_eq!(told.undo.as_deref(), Some("move a handle"));
}

#[test]
fn rulers_are_undone_one_by_one() {
    let mut model = model(BALL);
    let line = |to| Request::Measure { pane: Pane::Axial, from: [0.3; 2], to };
    let rulers = |told: Figures| told.rulers.len();
    for (n, to) in [[0.6, 0.6], [0.3, 0.7], [0.7, 0.3]].into_iter().enumerate() {
        follow(&mut model, &line(to));
        let told = model.figures();
        assert_eq!(told.rulers.iter().map(|ruler| ruler.now.len() - 1).sum::<usize>(), n + 1);
    }
    let counts: Vec<usize> = (0..3).map(|_| rulers(follow(&mut model, &Request::Undo))).collect();
    assert!(counts.windows(2).all(|two| two[1] <= two[0]) && counts[2] == 0, "{counts:?}");
    assert_eq!(model.figures().undo, None);
}

#[test]
fn colours_that_are_reset_come_back_with_how_bright_slices_were() {
    let mut model = model(BALL);
    let brighter = follow(&mut model, &Request::Window { by: [0.2, 0.1] });
    let reset = follow(&mut model, &Request::ResetColours);
    assert_ne!(reset.window, brighter.window);
    assert_eq!(follow(&mut model, &Request::Undo).window, brighter.window);
    assert_eq!(follow(&mut model, &Request::Redo).window, reset.window);
}

#[test]
fn a_slider_that_is_held_is_one_step_and_what_changes_nothing_is_none() {
    let by_classes = BALL.replace("[lattice]\niso = 127.5\n", "[segment]\nk = 3\n");
    let mut model = model(&by_classes.replace("mode = \"iso\"\niso = 127.5\n", ""));
    let before = model.figures();
    let class = before.classes.last().unwrap().clone();
    for opacity in [0.1, 0.2, 0.3] {
        let look = Request::Class {
            class: class.id,
            hidden: false,
            opacity: Some(opacity),
            colour: Some(class.colour.clone()),
        };
        follow(&mut model, &look);
    }
    assert_eq!(model.figures().classes.last().unwrap().opacity, 0.3);
    let undone = follow(&mut model, &Request::Undo);
    assert_eq!((undone.classes.clone(), undone.undo), (before.classes.clone(), None));
    // Taken hold of once more it is another.
    for opacity in [0.4, 0.5] {
        let colour = Some(class.colour.clone());
        let look = Request::Class { class: class.id, hidden: false, opacity: Some(opacity), colour };
        follow(&mut model, &look);
        follow(&mut model, &Request::Hover { pane: Pane::Volume, at: [0.5; 2] });
    }
    assert_eq!(follow(&mut model, &Request::Undo).classes.last().unwrap().opacity, 0.4);
    assert_eq!(follow(&mut model, &Request::Undo).classes, before.classes);
    let unknown = Request::Class { class: 60_000, hidden: true, opacity: None, colour: None };
    assert!(model.follow(&unknown).unwrap_err().to_string().contains("class 60000"));
    let reset = follow(&mut model, &Request::ResetColours);
    assert_eq!(reset.undo, None, "they were as they are");
}
