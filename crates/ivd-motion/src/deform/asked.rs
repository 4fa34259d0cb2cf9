use ivd_core::op::Job;
use nalgebra::Vector3;

use super::{Body, Bone, DynamicsMethod, ElasticMethod, Moves, ProjectiveMethod, RingMethod, XpbdMethod};

/// What is asked to move, whichever method does it.
#[derive(Debug, Clone, Copy)]
pub struct Asked<'a> {
    /// Handles, fixed places and shapes.
    pub moves: &'a Moves,
    /// Bones.
    pub bones: &'a [Bone],
}

impl<'a> Asked<'a> {
    /// Of a job; `None` where it is another stage's.
    pub fn of(job: &'a dyn Job) -> Option<Self> {
        fn body(body: &Body) -> Asked<'_> {
            Asked { moves: &body.moves, bones: &body.rigid }
        }
        let job = job.as_any();
        None.or_else(|| {
            job.downcast_ref().map(|method: &RingMethod| Asked { moves: &method.moves, bones: &[] })
        })
        .or_else(|| job.downcast_ref().map(|method: &DynamicsMethod| body(&method.body)))
        .or_else(|| job.downcast_ref().map(|method: &ProjectiveMethod| body(&method.body)))
        .or_else(|| job.downcast_ref().map(|method: &XpbdMethod| body(&method.body)))
        .or_else(|| {
            let asked = |method: &'a ElasticMethod| Asked { moves: &method.moves, bones: &method.rigid };
            job.downcast_ref().map(asked)
        })
    }

    /// Whether nothing moves.
    pub fn is_still(&self) -> bool {
        self.moves.handle.is_empty() && self.bones.is_empty() && self.moves.shape.is_empty()
    }

    /// The balls in which something moves: centre (mm), radius (mm), and how far the motion goes (mm), for what only the work
    /// itself tells a tenth of the radius. A handle that names a vertex has no centre.
    pub fn balls(self) -> impl Iterator<Item = (Option<[f64; 3]>, f64, f64)> + 'a {
        let ball = |centre, radius: f64, by: Option<[f64; 3]>| {
            (centre, radius, by.map_or(0.1 * radius, |by| Vector3::from(by).norm()))
        };
        let handles = self.moves.handle.iter().map(move |h| ball(h.pick, h.radius, h.by));
        let bones = self.bones.iter().map(move |b| {
            let (centre, radius) = b.ball();
            ball(centre, radius, b.by.filter(|_| b.angle.is_none()))
        });
        let shapes = self.moves.shape.iter().map(move |s| ball(Some(s.centre), s.radius, s.kind.way()));
        handles.chain(shapes).chain(bones)
    }
}
