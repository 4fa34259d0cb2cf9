//! The schema of a type, as parameters and figures are held against it and told of.

use std::any::TypeId;
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde_json::Value as Json;

/// JSON Schema of a type, without references. It is made once: every key that is read asks for it.
pub fn schema_of<T: JsonSchema + 'static>() -> &'static Json {
    static MADE: Mutex<BTreeMap<TypeId, &'static Json>> = Mutex::new(BTreeMap::new());
    let mut made = MADE.lock().unwrap_or_else(PoisonError::into_inner);
    made.entry(TypeId::of::<T>()).or_insert_with(|| Box::leak(Box::new(generated::<T>())))
}

fn generated<T: JsonSchema>() -> Json {
    let settings = SchemaSettings::draft2020_12().with(|settings| settings.inline_subschemas = true);
    let mut schema = settings.into_generator().into_root_schema_for::<T>().to_value();
    share_out(&mut schema);
    schema
}

/// Fields that an object has beside alternatives, as a flattened enum gives them, become fields of each of them: what else one of them
/// has belongs to it alone.
fn share_out(schema: &mut Json) {
    match schema {
        Json::Array(list) => list.iter_mut().for_each(share_out),
        Json::Object(object) => {
            object.values_mut().for_each(share_out);
            let Some(Json::Array(mut all)) = object.remove("oneOf") else { return };
            if let Some(Json::Object(shared)) = object.remove("properties") {
                let required = object.remove("required");
                let required = required.as_ref().and_then(Json::as_array);
                object.remove("type");
                for one in all.iter_mut().filter_map(Json::as_object_mut) {
                    one.insert("additionalProperties".to_owned(), Json::Bool(false));
                    if let Some(Json::Object(own)) = one.get_mut("properties") {
                        own.extend(shared.clone());
                    }
                    if let Some(Json::Array(own)) = one.get_mut("required") {
                        own.extend(required.into_iter().flatten().cloned());
                    }
                }
            }
            object.insert("oneOf".to_owned(), Json::Array(all));
        }
        Json::Null | Json::Bool(_) | Json::Number(_) | Json::String(_) => {}
    }
}
