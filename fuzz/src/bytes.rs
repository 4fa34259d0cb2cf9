/// Takes values off the front of the fuzzer's bytes; zeros where they have run out.
#[derive(Debug)]
pub struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    /// All of the bytes.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self(bytes)
    }

    /// What is left.
    pub fn rest(&self) -> &'a [u8] {
        self.0
    }

    fn take<const N: usize>(&mut self) -> [u8; N] {
        let n = self.0.len().min(N);
        let mut taken = [0; N];
        taken[..n].copy_from_slice(&self.0[..n]);
        self.0 = &self.0[n..];
        taken
    }

    /// One byte.
    pub fn u8(&mut self) -> u8 {
        self.take::<1>()[0]
    }

    /// A number below `end`.
    pub fn below(&mut self, end: usize) -> usize {
        usize::from(u16::from_le_bytes(self.take())) % end.max(1)
    }

    /// Any bit pattern.
    pub fn f32(&mut self) -> f32 {
        f32::from_le_bytes(self.take())
    }

    /// Mostly a number of everyday size, sometimes any bit pattern: the fuzzer reaches further behind the checks.
    pub fn f64(&mut self) -> f64 {
        match self.u8() {
            0..=199 => f64::from(i16::from_le_bytes(self.take())) / 256.0,
            200..=229 => f64::from(self.f32()),
            _ => f64::from_le_bytes(self.take()),
        }
    }

    /// Three numbers.
    pub fn triple(&mut self) -> [f64; 3] {
        [self.f64(), self.f64(), self.f64()]
    }
}
