// What was decided of the open cells, in their order: the bit in their word (5 bits), how many vertices of their own they have (3 bits), and the crossing.

fn bit_of(cell: u32) -> u32 {
    return cell & 31u;
}

fn own_of(cell: u32) -> u32 {
    return cell >> 5u & 7u;
}

fn crossing_of(cell: u32) -> u32 {
    return cell >> 8u;
}
