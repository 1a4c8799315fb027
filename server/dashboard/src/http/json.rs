//! Reads a request's JSON body.

use axum::Json;
use axum::extract::{FromRequest, Request};
use axum::response::{IntoResponse, Response};
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::error::Error;

/// 2^53. Below it, every JSON reader represents whole numbers exactly.
const EXACT: f64 = 9_007_199_254_740_992.0;

/// The body of a request, read from JSON. In JSON, and so in the description of this interface, 3.0
/// is the whole number 3, so it is accepted as an integer here too.
pub(super) struct JsonBody<T>(pub(super) T);

impl<S: Send + Sync, T: DeserializeOwned> FromRequest<S> for JsonBody<T> {
    type Rejection = Response;

    async fn from_request(request: Request, state: &S) -> Result<Self, Response> {
        let Json(mut body) = Json::<Value>::from_request(request, state).await.map_err(IntoResponse::into_response)?;
        make_whole(&mut body);

        serde_json::from_value(body).map(Self).map_err(|error| {
            let said = format!("The request's JSON is not as /api/openapi.json describes it: {error}.");
            Error::Invalid(said).into_response()
        })
    }
}

/// Turns whole numbers in `value` into integers.
fn make_whole(value: &mut Value) {
    match value {
        Value::Number(number) => {
            let whole = number.as_f64().filter(|float| number.is_f64() && float.fract() == 0.0 && float.abs() < EXACT);
            if let Some(whole) = whole {
                let whole = whole as i64;
                *value = whole.into();
            }
        }
        Value::Array(values) => values.iter_mut().for_each(make_whole),
        Value::Object(fields) => fields.values_mut().for_each(make_whole),
        Value::Null | Value::Bool(_) | Value::String(_) => {}
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn whole_numbers_are_integers_and_others_are_left_alone() {
        let mut value = json!({"a": [3.0, -2.0, 0.5, 1e300, 7], "b": {"c": 226.0, "d": "3.0", "e": null}});
        make_whole(&mut value);
        assert_eq!(value, json!({"a": [3, -2, 0.5, 1e300, 7], "b": {"c": 226, "d": "3.0", "e": null}}));
    }
}
