use serde_json::{Map, Number, Value as Json};
use toml::Value;

use ivd_core::ParamError;

/// A TOML value as JSON.
///
/// # Errors
/// A number that isn't finite, a date: no parameter is one. The problem's path starts at the value.
pub fn from_toml(value: Value) -> Result<Json, ParamError> {
    Ok(match value {
        Value::String(text) => Json::String(text),
        Value::Integer(number) => Json::Number(number.into()),
        Value::Float(number) => {
            let finite = Number::from_f64(number);
            Json::Number(
                finite.ok_or_else(|| ParamError::at_itself(format!("{number}"), "give a finite number"))?,
            )
        }
        Value::Boolean(truth) => Json::Bool(truth),
        Value::Datetime(date) => {
            return Err(ParamError::at_itself(format!("{date}, a date"), "no parameter is one"));
        }
        Value::Array(list) => {
            let item = |(i, item)| from_toml(item).map_err(|e| e.under(&format!("{i}")));
            Json::Array(list.into_iter().enumerate().map(item).collect::<Result<_, _>>()?)
        }
        Value::Table(table) => {
            let mut object = Map::new();
            for (key, value) in table {
                let value = from_toml(value).map_err(|e| e.under(&key))?;
                object.insert(key, value);
            }
            Json::Object(object)
        }
    })
}
