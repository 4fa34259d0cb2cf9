use ivd_artefact::Cache;
use ivd_core::Exec;
use ivd_frames::{Model, Patience, Subject, Tell};
use ivd_pipeline::scene::{Loaded, parse};

/// A ball of 32³ voxels of 1 mm with values that fall outwards, cut halfway.
pub(crate) const BALL: &str = include_str!("ball.toml");

pub(crate) fn loaded(text: &str) -> Loaded {
    Loaded { scene: parse(text, &[]).unwrap(), folder: ".".into(), file: "scene.toml".into() }
}

/// What a scene shows. It waits as long as it takes: what comes of a drag is the same on every machine.
pub(crate) fn model(text: &str) -> Model {
    let exec = Exec::default();
    let subject = Subject::open(&loaded(text), false, &Cache::disabled(), &exec, &Tell::default()).unwrap();
    patient(subject, exec)
}

/// The same of what was opened.
pub(crate) fn patient(subject: Subject, exec: Exec) -> Model {
    let mut model = Model::new(subject, [128, 128], exec).unwrap();
    model.wait(Patience::ENDLESS);
    model
}

/// Numbers that look random.
pub(crate) struct Draw(pub(crate) u64);

impl Draw {
    pub(crate) fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) as usize) % n
    }

    pub(crate) fn unit(&mut self) -> f64 {
        self.below(1 << 20) as f64 / f64::from(1 << 20)
    }
}
