//! Values of parameters, as the parameter services carry them.

use crate::parameter::ParameterValue;
use crate::wire::rcl_interfaces::msg as wire;
use wire::ParameterType as Type;

/// `None`: the parameter is not set.
pub fn parameter_to_wire(value: Option<&ParameterValue>) -> wire::ParameterValue {
    let mut wire = wire::ParameterValue::default();
    wire.type_ = match value {
        None => Type::PARAMETER_NOT_SET,
        Some(ParameterValue::Bool(value)) => {
            wire.bool_value = *value;
            Type::PARAMETER_BOOL
        }
        Some(ParameterValue::Integer(value)) => {
            wire.integer_value = *value;
            Type::PARAMETER_INTEGER
        }
        Some(ParameterValue::Double(value)) => {
            wire.double_value = *value;
            Type::PARAMETER_DOUBLE
        }
        Some(ParameterValue::String(value)) => {
            wire.string_value.clone_from(value);
            Type::PARAMETER_STRING
        }
        Some(ParameterValue::BoolArray(values)) => {
            wire.bool_array_value.clone_from(values);
            Type::PARAMETER_BOOL_ARRAY
        }
        Some(ParameterValue::IntegerArray(values)) => {
            wire.integer_array_value.clone_from(values);
            Type::PARAMETER_INTEGER_ARRAY
        }
        Some(ParameterValue::DoubleArray(values)) => {
            wire.double_array_value.clone_from(values);
            Type::PARAMETER_DOUBLE_ARRAY
        }
        Some(ParameterValue::StringArray(values)) => {
            wire.string_array_value.clone_from(values);
            Type::PARAMETER_STRING_ARRAY
        }
    };
    wire
}

/// `None` for "not set" and for byte arrays, which no parameter here has.
pub fn parameter_from_wire(wire: &wire::ParameterValue) -> Option<ParameterValue> {
    match wire.type_ {
        Type::PARAMETER_BOOL => Some(wire.bool_value.into()),
        Type::PARAMETER_INTEGER => Some(wire.integer_value.into()),
        Type::PARAMETER_DOUBLE => Some(wire.double_value.into()),
        Type::PARAMETER_STRING => Some(wire.string_value.clone().into()),
        Type::PARAMETER_BOOL_ARRAY => Some(wire.bool_array_value.clone().into()),
        Type::PARAMETER_INTEGER_ARRAY => Some(wire.integer_array_value.clone().into()),
        Type::PARAMETER_DOUBLE_ARRAY => Some(wire.double_array_value.clone().into()),
        Type::PARAMETER_STRING_ARRAY => Some(wire.string_array_value.clone().into()),
        _ => None,
    }
}
