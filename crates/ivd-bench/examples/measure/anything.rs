/// What a program gives, or whatever went wrong.
pub(crate) type Anything<T> = Result<T, Box<dyn std::error::Error>>;
