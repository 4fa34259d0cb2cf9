//! Places in one line, as a command line gives them.

/// Reads `x,y,z`, three finite numbers.
///
/// # Errors
/// A sentence with what was written and what to write.
pub fn triple(text: &str) -> Result<[f64; 3], String> {
    let parts: Vec<f64> = text
        .split(',')
        .map(|p| p.trim().parse::<f64>())
        .collect::<Result<_, _>>()
        .map_err(|e| format!("`{text}`: {e}; write x,y,z"))?;
    let parts: [f64; 3] = parts.try_into().map_err(|_| format!("`{text}`: write three numbers, x,y,z"))?;
    if parts.iter().all(|p| p.is_finite()) { Ok(parts) } else { Err(format!("`{text}`: must be finite")) }
}
