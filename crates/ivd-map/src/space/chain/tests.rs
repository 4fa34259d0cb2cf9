use ivd_field::fixtures::{sheared_grid, voxels};

use super::*;

fn mail() -> ChainMail {
    ChainMail {
        centre: [0.0; 3],
        grip: 1.2,
        by: [3.0, -2.0, 1.0],
        links: Links { shrink: 0.6, stretch: 1.25, shear: 0.3 },
        material: BTreeMap::new(),
    }
}

/// A class for every voxel, by a hash.
fn classes(grid: &Grid) -> Labels {
    let ids: Vec<u16> = (0..grid.len()).map(|i| ((i * 2_654_435_761) >> 7) as u16 % 3).collect();
    Labels::new(grid.clone(), ids.into(), Vec::new()).unwrap()
}

/// Every link of a solved component keeps its limits, and every voxel that moves is held by one of them or gripped.
fn check_limits(grid: &Grid, field: &FieldBricks, links: impl Fn(usize) -> Links, gripped: &[[usize; 3]]) {
    let to_voxel = grid.inverse_linear_part();
    let d = |v: [usize; 3]| to_voxel * Vector3::from(field.at(VoxelIndex(v))).map(f64::from);
    for voxel in voxels(grid) {
        let own = d(voxel.0);
        let mut held = own.map(|c| c.abs() < 1e-5);
        for a in 0..3 {
            for up in [true, false] {
                let mut next = voxel.0;
                next[a] = if up { next[a] + 1 } else { next[a].wrapping_sub(1) };
                if next[a] >= grid.dims()[a] {
                    continue;
                }
                let (mine, theirs) = (links(grid.linear(voxel)), links(grid.linear(VoxelIndex(next))));
                for c in 0..3 {
                    let mean = |of: fn(&Links) -> f64| 0.5 * (of(&mine) + of(&theirs));
                    let change = if up { d(next)[c] - own[c] } else { own[c] - d(next)[c] };
                    let shear = mean(|l| l.shear) * step(grid, c)[a];
                    let (least, most) = if a == c {
                        (mean(|l| l.shrink) - 1.0, mean(|l| l.stretch) - 1.0)
                    } else {
                        (-shear, shear)
                    };
                    assert!(change >= least - 1e-5 && change <= most + 1e-5, "{voxel:?} {a} {c}: {change}");
                    // The link is at its limit, and pulls this voxel along.
                    let at_limit = (change - least).abs() < 1e-5 || (change - most).abs() < 1e-5;
                    held[c] |= at_limit && d(next)[c].abs() >= own[c].abs() - 1e-6;
                }
            }
        }
        assert!(held.iter().all(|h| *h) || gripped.contains(&voxel.0), "{voxel:?} moves by itself: {own}");
    }
}

#[test]
fn every_limit_is_kept_and_nothing_moves_that_no_link_pulls() {
    let grid = sheared_grid([21, 17, 9]);
    let centre = ivd_field::fixtures::middle(&grid);
    let mail = ChainMail { centre: centre.into(), ..mail() };
    let gripped = mail.gripped(&grid, &Exec::default()).unwrap();
    assert!(gripped.len() > 10, "{}", gripped.len());
    let field = mail.field(&grid, None, &Exec::default()).unwrap();
    check_limits(&grid, &field, |_| mail.links, &gripped);
    let hard = Links { shrink: 1.0, stretch: 1.0, shear: 0.05 };
    let mixed =
        ChainMail { material: [(1, hard.into()), (2, Links::default().into())].into(), ..mail.clone() };
    let labels = classes(&grid);
    let field = mixed.field(&grid, Some(&labels), &Exec::default()).unwrap();
    check_limits(&grid, &field, |i| *mixed.classes().get(&labels.ids()[i]).unwrap_or(&mixed.links), &gripped);
}

#[test]
fn sweeps_find_what_paths_find() {
    let grid = sheared_grid([21, 17, 9]);
    for (grip, by) in [(0.0, [3.0, -2.0, 1.0]), (2.5, [-1.0, 0.0, 6.0]), (0.5, [0.0, 90.0, 0.0])] {
        let mail = ChainMail { centre: ivd_field::fixtures::middle(&grid).into(), grip, by, ..mail() };
        let alike = ChainMail { material: [(1, mail.links.into())].into(), ..mail.clone() };
        let [swept, walked] = [(&mail, None), (&alike, Some(classes(&grid)))]
            .map(|(mail, labels)| mail.field(&grid, labels.as_ref(), &Exec::default()).unwrap());
        for v in voxels(&grid) {
            let off = Vector3::from(swept.at(v)) - Vector3::from(walked.at(v));
            assert!(off.norm() < 1e-4, "{v:?}: {off}");
        }
    }
}

#[test]
fn links_that_never_give_way_move_everything_alike() {
    let grid = sheared_grid([9, 10, 11]);
    let stiff = Links { shrink: 1.0, stretch: 1.0, shear: 0.0 };
    let mail = ChainMail { centre: ivd_field::fixtures::middle(&grid).into(), links: stiff, ..mail() };
    let field = mail.field(&grid, None, &Exec::default()).unwrap();
    for v in voxels(&grid) {
        let off = Vector3::from(field.at(v)).map(f64::from) - Vector3::from(mail.by);
        assert!(off.norm() < 1e-5);
    }
}

#[test]
fn a_grip_outside_and_limits_out_of_their_domain_are_named() {
    let grid = sheared_grid([9, 10, 11]);
    let far = ChainMail { centre: [1e3; 3], ..mail() };
    assert!(far.field(&grid, None, &Exec::default()).unwrap_err().to_string().contains("outside the volume"));
    for (field, links) in [
        ("shrink", Links { shrink: 0.0, ..Links::default() }),
        ("stretch", Links { stretch: 0.9, ..Links::default() }),
        ("shear", Links { shear: f64::NAN, ..Links::default() }),
    ] {
        assert_eq!(ChainMail { links, ..mail() }.check().unwrap_err().field, field);
        assert_eq!(
            ChainMail { material: [(7, links.into())].into(), ..mail() }.check().unwrap_err().field,
            format!("material.7.{field}")
        );
    }
}
