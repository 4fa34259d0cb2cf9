//! Agreement of labels and masks.

use serde_json::{Value, json};

use super::confusion::Confusion;
use super::matching::matching;

/// Dice of each class with its partner, adjusted Rand index (Hubert & Arabie 1985) and the confusion table.
///
/// Partners are one to one, and chosen so that the sum of Dice is largest; beside it Dice with the class of the same label.
pub(super) fn labels(a: &[u16], b: &[u16]) -> Value {
    let table = Confusion::of(a, b);
    let matched = matching(&table);
    let classes: Vec<Value> = table
        .rows
        .iter()
        .map(|(p, n)| {
            let partner = matched.pairs.get(p);
            let same = if table.shared.contains_key(&(*p, *p)) { table.dice(*p, *p) } else { 0.0 };
            json!({ "a": p, "b": partner, "dice": partner.map_or(0.0, |&q| table.dice(*p, q)), "dice_same_label": same, "voxels_a": n,
                "voxels_b": partner.map(|q| table.columns[q]) })
        })
        .collect();
    let shared: Vec<Value> =
        table.shared.iter().map(|((p, q), n)| json!({ "a": p, "b": q, "voxels": n })).collect();
    let differing = a.iter().zip(b).filter(|(p, q)| p != q).count();
    let mut told =
        json!({ "unproven": matched.unproven, "ari": table.adjusted_rand(), "differing": differing });
    // Moved, not copied as the macro does: thousands of classes have millions of pairs, of a kilobyte each.
    told["classes"] = Value::Array(classes);
    told["confusion"] = Value::Array(shared);
    told
}

/// Dice of two masks.
pub(super) fn masks(a: &[u8], b: &[u8]) -> Value {
    let (mut both, mut na, mut nb) = (0_u64, 0_u64, 0_u64);
    for (&p, &q) in a.iter().zip(b) {
        both += u64::from(p & q);
        na += u64::from(p);
        nb += u64::from(q);
    }
    let dice = if na + nb == 0 { 1.0 } else { 2.0 * both as f64 / (na + nb) as f64 };
    json!({ "dice": dice, "voxels_a": na, "voxels_b": nb, "both": both })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn renamed_classes_agree_wholly() {
        let a = [1, 1, 2, 2, 3, 3];
        let b = [7, 7, 5, 5, 6, 6];
        let error = labels(&a, &b);
        assert_eq!(error["ari"].as_f64(), Some(1.0));
        assert!(error["classes"].as_array().unwrap().iter().all(|c| c["dice"] == 1.0));
        assert!(error["classes"].as_array().unwrap().iter().all(|c| c["dice_same_label"] == 0.0));
        let swapped = labels(&[1, 1, 2, 2], &[1, 2, 2, 2]);
        assert_eq!(swapped["classes"][1]["dice_same_label"].as_f64(), Some(0.8));
    }

    #[test]
    fn partners_are_those_of_the_largest_sum_of_dice() {
        // Class 1 shares most with class 1, but then class 2 is left with nothing.
        let a = [[1; 60].as_slice(), &[1; 30], &[2; 30]].concat();
        let b = [[1; 60].as_slice(), &[2; 30], &[1; 30]].concat();
        let error = labels(&a, &b);
        let found = |class: usize, key| &error["classes"][class][key];
        assert_eq!((found(0, "b"), found(1, "b")), (&json!(2), &json!(1)));
        assert_eq!(found(0, "dice").as_f64(), Some(60.0 / 120.0));
        assert_eq!((&error["unproven"], &error["confusion"][0]["voxels"]), (&json!(0), &json!(60)));
    }

    #[test]
    fn dice_of_masks() {
        assert_eq!(masks(&[1, 1, 0], &[1, 0, 0])["dice"].as_f64(), Some(2.0 / 3.0));
        assert_eq!(masks(&[0, 0], &[0, 0])["dice"].as_f64(), Some(1.0));
    }
}
