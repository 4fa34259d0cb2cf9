use ivd_render::plan::{Plan, PlanLook, PlanVoxels};

/// The names that a plan's shader is put together with.
pub(super) fn defines(plan: &Plan<'_>) -> Vec<&'static str> {
    let voxels = match plan.voxels {
        PlanVoxels::U8(_) => "U8",
        PlanVoxels::U16(_) => "U16",
        PlanVoxels::I16(_) => "I16",
        PlanVoxels::F32(_) => "F32",
    };
    let mut names = vec![voxels];
    match plan.look {
        PlanLook::Classified { steep, shaded, .. } => {
            names.push("DVR");
            names.extend(plan.labels.map(|_| "LABELLED"));
            names.extend(steep.map(|_| "STEEP"));
            names.extend(shaded.then_some("SHADED"));
        }
        PlanLook::Maximum { .. } => names.push("MAXIMUM"),
        PlanLook::Surface { .. } => names.push("SURFACE"),
    }
    names.extend(plan.moved.map(|_| "MOVED"));
    names
}

/// Every list of names that [`defines`] can give.
#[cfg(test)]
pub(super) fn all() -> Vec<Vec<&'static str>> {
    let mut all = Vec::new();
    for voxels in ["U8", "U16", "I16", "F32"] {
        for moved in [None, Some("MOVED")] {
            for bits in 0..8_u8 {
                let of = |bit: u8, name| (bits >> bit & 1 == 1).then_some(name);
                let flags = [of(0, "LABELLED"), of(1, "STEEP"), of(2, "SHADED"), moved];
                all.push([voxels, "DVR"].into_iter().chain(flags.into_iter().flatten()).collect());
            }
            for mode in ["MAXIMUM", "SURFACE"] {
                all.push([voxels, mode].into_iter().chain(moved).collect());
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cast::numbers::PARAMS_BYTES;
    use crate::shader::assemble;
    use crate::shader::tests::valid;
    use naga::valid::Capabilities;

    #[test]
    fn every_shader_of_pictures_is_valid_on_the_least_device_and_reads_params_as_they_are_written() {
        for names in all() {
            let module = valid("render/cast.wgsl", &names, Capabilities::empty());
            let params = module.types.iter().find(|(_, t)| t.name.as_deref() == Some("Params"));
            let naga::TypeInner::Struct { span, .. } = params.unwrap().1.inner else { panic!("a struct") };
            assert_eq!(u64::from(span), PARAMS_BYTES);
        }
        valid("render/rays.wgsl", &[], Capabilities::FLOAT64);
        // Numbers that stand in shaders and in the processor's code.
        let surface = assemble("render/cast.wgsl", &["U8", "SURFACE"]).unwrap().text;
        assert!(surface.contains(&format!("halvings >= {}u", ivd_render::plan::HALVINGS)));
        assert_eq!((ivd_core::BRICK, 1 << 3), (8, ivd_core::BRICK), "bricks are found by shifts by 3");
    }
}
