use ivd_core::{Error as CoreError, Exec, NO_DATA, TransferEntry, TransferFunction, Volume};

use crate::built::{Built, reference_mm};
use crate::colour;
use crate::error::Error;
use crate::figures::Figures;
use crate::params::Params;
use crate::range::range_of;
use crate::roles::{Role, are_hounsfield};

/// Share of the value range over which opacity rises at the isovalue.
const RISE: f64 = 1.0 / 64.0;

/// A transfer function for a volume of which only an isovalue is known: clear below, one colour above, with no pass
/// over the voxels but their range. A scene that gives its isovalue needs no segmentation to be drawn.
///
/// Opacity rises linearly over 1/64 of the volume's range, centred on `iso` (a real value), to `max_opacity`: what lies above is the only material,
/// and has the greatest opacity by either rule. Its colour is that of the palette at `iso`; what else of `params` is for classes has no use here.
///
/// # Errors
/// [`ivd_core::Error::Param`]; [`Error::Core`] for an isovalue that isn't finite; [`Error::TooWide`] for values beyond ±10¹⁴⁰.
pub fn from_isovalue(volume: &Volume, iso: f64, params: &Params, exec: &Exec) -> Result<Built, Error> {
    params.require_valid()?;
    if !iso.is_finite() {
        return Err(
            CoreError::Inconsistent { what: "isovalue", problem: format!("{iso} is not finite") }.into()
        );
    }
    let range = exec.run(|| range_of(volume))?;
    let half = 0.5 * RISE * (range[1] - range[0]);
    let value = |i: usize| range[0] + (range[1] - range[0]) * (i as f64 / (params.resolution - 1) as f64);
    let weight = |v: f64| {
        if half > 0.0 {
            ((v - iso) / (2.0 * half) + 0.5).clamp(0.0, 1.0)
        } else {
            f64::from(u8::from(v >= iso))
        }
    };
    let hounsfield = are_hounsfield(params.values, volume.modality(), range);
    let palette = colour::chosen(params.palette, hounsfield, volume.modality(), false);
    let [r, g, b] = colour::of_isovalue(palette, hounsfield, iso, range);
    let most = params.max_opacity as f32;
    let table = (0..params.resolution).map(|i| [r, g, b, most * weight(value(i)) as f32]).collect();
    let entry = TransferEntry {
        class: NO_DATA,
        role: Role::Material,
        rgb: [r, g, b],
        opacity: most,
        lower: iso,
        upper: range[1],
        softness: half,
    };
    let transfer = TransferFunction::new(
        range,
        params.resolution,
        reference_mm(volume.grid()),
        vec![NO_DATA],
        table,
        vec![entry],
    )?;
    let figures = Figures::of_entries(&transfer, palette, hounsfield);
    Ok(Built { transfer, figures })
}

#[cfg(test)]
mod tests {
    use super::*;
    use ivd_core::{Grid, Voxels};

    #[test]
    fn clear_below_half_at_and_opaque_above_the_isovalue() {
        let grid = Grid::with_spacing([256, 1, 1], [1.0; 3]).unwrap();
        let volume = Volume::new(grid, Voxels::from((0..=255).collect::<Vec<u8>>())).unwrap();
        let params = Params { resolution: 4096, max_opacity: 0.8, ..Params::default() };
        let built = from_isovalue(&volume, 100.0, &params, &Exec::default()).unwrap();
        let opacity = |v: f64| built.transfer.sample(0, v)[3];
        assert_eq!((opacity(90.0), opacity(110.0)), (0.0, 0.8));
        assert!((opacity(100.0) - 0.4).abs() < 0.02);
        assert!(from_isovalue(&volume, f64::NAN, &params, &Exec::default()).is_err());
    }

    #[test]
    fn its_colour_is_that_of_the_palette_at_the_isovalue() {
        use crate::params::{Palette, ValueScale};
        let grid = Grid::with_spacing([2, 2, 2], [1.0; 3]).unwrap();
        let values = vec![-1000_i16, 0, 40, 900, 1000, 0, 0, 0];
        let volume = Volume::new(grid, Voxels::from(values)).unwrap();
        let of = |palette, values, iso| {
            let params = Params { palette, values, ..Params::default() };
            let built = from_isovalue(&volume, iso, &params, &Exec::default()).unwrap();
            (built.transfer.entries()[0].rgb, built.figures.palette, built.figures.hounsfield)
        };
        let (muscle, palette, hounsfield) = of(Palette::Auto, ValueScale::Auto, 40.0);
        assert!(muscle[0] > 2.0 * muscle[1] && palette == Palette::Tissue && hounsfield);
        let (bone, ..) = of(Palette::Auto, ValueScale::Auto, 900.0);
        assert!(bone.iter().all(|c| *c > 0.5));
        let (plain, palette, hounsfield) = of(Palette::Auto, ValueScale::Plain, 40.0);
        assert!(plain == colour::class_colour(0) && palette == Palette::Safe && !hounsfield);
        assert_ne!(
            of(Palette::Thesis, ValueScale::Auto, 40.0).0,
            of(Palette::Thesis, ValueScale::Auto, 900.0).0
        );
    }

    #[test]
    fn a_constant_volume_is_either_seen_or_not() {
        let grid = Grid::with_spacing([2, 2, 2], [1.0; 3]).unwrap();
        let volume = Volume::new(grid, Voxels::from(vec![7_u8; 8])).unwrap();
        let at = |iso| {
            from_isovalue(&volume, iso, &Params::default(), &Exec::default()).unwrap().transfer.sample(0, 7.0)
                [3]
        };
        assert_eq!((at(8.0), at(7.0)), (0.0, Params::default().max_opacity as f32));
    }
}
