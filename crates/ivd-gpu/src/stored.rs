//! Stored values as ranks, as shared/stored.wgsl has them.

use ivd_core::{VoxelType, Voxels};

/// The rank of a value that the type holds.
pub(crate) fn rank(of: VoxelType, value: f64) -> u32 {
    match of {
        VoxelType::I8 => (value as i8 as u8 ^ 0x80).into(),
        VoxelType::I16 => (value as i16 as u16 ^ 0x8000).into(),
        VoxelType::F32 => {
            let bits = (value as f32 + 0.0).to_bits();
            if bits >> 31 == 1 { !bits } else { bits | 0x8000_0000 }
        }
        _ => value as u32,
    }
}

/// The value of a rank.
pub(crate) fn value(of: VoxelType, rank: u32) -> f32 {
    match of {
        VoxelType::I8 => f32::from((rank as u8 ^ 0x80) as i8),
        VoxelType::I16 => f32::from((rank as u16 ^ 0x8000) as i16),
        VoxelType::F32 => f32::from_bits(if rank >> 31 == 1 { rank & 0x7fff_ffff } else { !rank }),
        _ => rank as f32,
    }
}

/// Whether a value takes one byte.
pub(crate) fn is_byte(voxels: &Voxels) -> bool {
    voxels.voxel_type().bytes() == 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_ascend_with_values_and_lead_back_to_them() {
        let all = [
            (VoxelType::U8, vec![0.0, 1.0, 255.0]),
            (VoxelType::I8, vec![-128.0, -1.0, 0.0, 127.0]),
            (VoxelType::U16, vec![0.0, 255.0, 65_535.0]),
            (VoxelType::I16, vec![-32_768.0, -1.0, 0.0, 32_767.0]),
            (VoxelType::F32, vec![-3e38, -1.5, -1e-44, 0.0, 1e-44, 1e-38, 7.25, 3e38]),
        ];
        for (of, values) in all {
            let ranks: Vec<u32> = values.iter().map(|v| rank(of, *v)).collect();
            assert!(ranks.is_sorted_by(|a, b| a < b), "{of:?}: {ranks:?}");
            let back: Vec<f32> = ranks.iter().map(|r| value(of, *r)).collect();
            assert_eq!(back, values.iter().map(|v| *v as f32).collect::<Vec<f32>>());
        }
        assert_eq!(rank(VoxelType::F32, -0.0), rank(VoxelType::F32, 0.0));
    }
}
