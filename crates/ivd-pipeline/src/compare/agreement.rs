//! Agreement of labels and masks.

use std::collections::BTreeMap;

use serde_json::{Value, json};

/// Dice of each class with its best match, adjusted Rand index (Hubert & Arabie 1985) and the confusion table.
///
/// Matches are made one to one, the largest Dice first.
pub(super) fn labels(a: &[u16], b: &[u16]) -> Value {
    let table = confusion(a, b);
    let (rows, columns) = margins(&table);
    let mut pairs: Vec<(f64, u16, u16)> =
        table.iter().map(|(&(p, q), &n)| (2.0 * n as f64 / (rows[&p] + columns[&q]) as f64, p, q)).collect();
    pairs.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)).then(x.2.cmp(&y.2)));
    let mut matched: BTreeMap<u16, (u16, f64)> = BTreeMap::new();
    for (dice, p, q) in pairs {
        if !matched.contains_key(&p) && matched.values().all(|(taken, _)| *taken != q) {
            matched.insert(p, (q, dice));
        }
    }
    let classes: Vec<Value> = rows
        .iter()
        .map(|(p, n)| {
            let found = matched.get(p);
            json!({ "a": p, "b": found.map(|m| m.0), "dice": found.map_or(0.0, |m| m.1), "voxels_a": n,
                "voxels_b": found.map(|m| columns[&m.0]) })
        })
        .collect();
    let table: Vec<Value> = table.iter().map(|((p, q), n)| json!({ "a": p, "b": q, "voxels": n })).collect();
    let differing = a.iter().zip(b).filter(|(p, q)| p != q).count();
    json!({ "classes": classes, "ari": adjusted_rand(a, b), "differing": differing, "confusion": table })
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

type Confusion = BTreeMap<(u16, u16), u64>;

fn confusion(a: &[u16], b: &[u16]) -> Confusion {
    let mut table = Confusion::new();
    // Labels come in runs: count a run at once.
    let mut i = 0;
    while i < a.len() {
        let start = i;
        while i < a.len() && a[i] == a[start] && b[i] == b[start] {
            i += 1;
        }
        *table.entry((a[start], b[start])).or_default() += (i - start) as u64;
    }
    table
}

type Margins = (BTreeMap<u16, u64>, BTreeMap<u16, u64>);

fn margins(table: &Confusion) -> Margins {
    let (mut rows, mut columns) = Margins::default();
    for (&(p, q), &n) in table {
        *rows.entry(p).or_default() += n;
        *columns.entry(q).or_default() += n;
    }
    (rows, columns)
}

/// 1 for equal partitions, about 0 for unrelated ones; 1 where both put everything into one class.
fn adjusted_rand(a: &[u16], b: &[u16]) -> f64 {
    let table = confusion(a, b);
    let (rows, columns) = margins(&table);
    let pairs = |n: u64| n as f64 * (n as f64 - 1.0) / 2.0;
    let both: f64 = table.values().map(|&n| pairs(n)).sum();
    let in_a: f64 = rows.values().map(|&n| pairs(n)).sum();
    let in_b: f64 = columns.values().map(|&n| pairs(n)).sum();
    let expected = in_a * in_b / pairs(a.len() as u64).max(1.0);
    let most = f64::midpoint(in_a, in_b);
    if most == expected { 1.0 } else { (both - expected) / (most - expected) }
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
    }

    #[test]
    fn adjusted_rand_index_of_a_worked_example() {
        // Confusion rows (2, 1), (0, 3): sum of pairs 1 + 3 = 4, margins 3, 3 → 6 and 2, 4 → 7 of 15.
        let ari = adjusted_rand(&[1, 1, 1, 2, 2, 2], &[1, 1, 2, 2, 2, 2]);
        let expected = 6.0 * 7.0 / 15.0;
        assert!((ari - (4.0 - expected) / (6.5 - expected)).abs() < 1e-12);
    }

    #[test]
    fn dice_of_masks() {
        assert_eq!(masks(&[1, 1, 0], &[1, 0, 0])["dice"].as_f64(), Some(2.0 / 3.0));
        assert_eq!(masks(&[0, 0], &[0, 0])["dice"].as_f64(), Some(1.0));
    }
}
