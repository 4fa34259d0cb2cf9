// The stored voxels as ranks: whole numbers that ascend with their values. Comparing them is exact on every device, which floats are not where one takes
// small numbers for 0.

fn rank_of_float(word: u32) -> u32 {
    // −0 is 0.
    let bits = select(word, 0u, word == 0x80000000u);
    return select(bits | 0x80000000u, ~bits, (bits & 0x80000000u) != 0u);
}

// Whether a rank is that of a number: neither infinite nor none.
fn is_number(rank: u32) -> bool {
//#if F32
    return rank > 0x007fffffu && rank < 0xff800000u;
//#else
    return true;
//#end
}

fn rank(i: u32) -> u32 {
//#if U8
    return (volume[i >> 2u] >> ((i & 3u) * 8u)) & 0xffu;
//#end
//#if I8
    return ((volume[i >> 2u] >> ((i & 3u) * 8u)) & 0xffu) ^ 0x80u;
//#end
//#if U16
    return (volume[i >> 1u] >> ((i & 1u) * 16u)) & 0xffffu;
//#end
//#if I16
    return ((volume[i >> 1u] >> ((i & 1u) * 16u)) & 0xffffu) ^ 0x8000u;
//#end
//#if F32
    return rank_of_float(volume[i]);
//#end
}

// Of the four voxels from 4 q on.
fn ranks(q: u32) -> vec4<u32> {
//#if U8
    return (vec4<u32>(volume[q]) >> vec4<u32>(0u, 8u, 16u, 24u)) & vec4<u32>(0xffu);
//#end
//#if I8
    return ((vec4<u32>(volume[q]) >> vec4<u32>(0u, 8u, 16u, 24u)) & vec4<u32>(0xffu)) ^ vec4<u32>(0x80u);
//#end
//#if U16
    let two = vec2<u32>(volume[2u * q], volume[2u * q + 1u]);
    return (two.xxyy >> vec4<u32>(0u, 16u, 0u, 16u)) & vec4<u32>(0xffffu);
//#end
//#if I16
    let two = vec2<u32>(volume[2u * q], volume[2u * q + 1u]);
    return ((two.xxyy >> vec4<u32>(0u, 16u, 0u, 16u)) & vec4<u32>(0xffffu)) ^ vec4<u32>(0x8000u);
//#end
//#if F32
    return vec4<u32>(rank(4u * q), rank(4u * q + 1u), rank(4u * q + 2u), rank(4u * q + 3u));
//#end
}
