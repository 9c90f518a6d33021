//! The parameters of a node and their values.
//!
//! Pure. `declared` has the types and ranges, `parameter_file` reads files and arguments,
//! and `parameter_services` serves other nodes.

use super::common::use_sim_time;
use super::declared::Declared;
use cnc_msgs::parameter::ParameterValue;
use std::collections::BTreeMap;
use std::fmt;

/// Why a parameter cannot be read or set.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ParameterError {
    #[error("{origin}parameter \"{name}\": {reason}")]
    Value { origin: Origin, name: String, reason: String },
    #[error("{origin}parameter \"{name}\" is not one of this node's: {known}")]
    Unknown { origin: Origin, name: String, known: String },
    #[error("{origin}parameter \"{name}\" is called \"{now}\" now")]
    Renamed { origin: Origin, name: String, now: String },
    #[error(
        "{origin}parameter \"{name}\" belongs to no node{}",
        meant.as_ref().map(|meant| format!("; did you mean \"{meant}\"?")).unwrap_or_default()
    )]
    OfNoNode { origin: Origin, name: String, meant: Option<String> },
    #[error("parameter \"{name}\" is read-only: it is set at the start of the node")]
    ReadOnly { name: String },
    #[error("parameter \"{name}\" is declared twice")]
    Twice { name: String },
}

/// Where a value was found; empty when it came over the network.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Origin(pub String);

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() { Ok(()) } else { write!(f, "{}: ", self.0) }
    }
}

/// A value for a parameter from a file or an argument.
#[derive(Debug, Clone, PartialEq)]
pub struct Override {
    pub name: String,
    /// `None` is an empty list, which may be any array.
    pub value: Option<ParameterValue>,
    pub origin: Origin,
    /// Its section may be meant for other nodes too: it is not an error if this node has
    /// no such parameter.
    pub is_shared: bool,
}

/// All parameters of a node with their values.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters {
    entries: BTreeMap<String, (Declared, ParameterValue)>,
}

impl Parameters {
    /// Declares `use_sim_time` and the given ones, each with its default.
    ///
    /// # Errors
    /// A name twice, or a default outside its own range.
    pub fn declare(declared: Vec<Declared>) -> Result<Self, ParameterError> {
        let mut entries = BTreeMap::new();
        for parameter in std::iter::once(use_sim_time()).chain(declared) {
            let (name, value) = (parameter.name.clone(), parameter.default.clone());
            parameter.check(&value).map_err(|reason| ParameterError::Value {
                origin: Origin("default".to_owned()),
                name: name.clone(),
                reason,
            })?;
            if entries.insert(name.clone(), (parameter, value)).is_some() {
                return Err(ParameterError::Twice { name });
            }
        }
        Ok(Self { entries })
    }

    /// Takes the values of files and arguments, later ones over earlier ones;
    /// read-only ones too. Returns what was skipped, for the log.
    ///
    /// # Errors
    /// All values that do not fit; nothing is changed then.
    pub fn apply(&mut self, overrides: &[Override]) -> Result<Vec<String>, Vec<ParameterError>> {
        let mut errors = Vec::new();
        let mut warnings = Vec::new();
        let mut taken = self.entries.clone();
        for found in overrides {
            let Some((declared, value)) = taken.get_mut(&found.name) else {
                let is_meant_here = !found.is_shared || self.renamed(&found.name).is_some();
                if !is_meant_here || Self::is_of_ros(&found.name) {
                    let (origin, name) = (&found.origin, &found.name);
                    warnings.push(format!("{origin}parameter \"{name}\" has no effect here"));
                } else {
                    errors.push(self.unknown(&found.name, found.origin.clone()));
                }
                continue;
            };
            let given = match &found.value {
                Some(given) => declared.as_written(given),
                None => declared.default.emptied(),
            };
            match declared.check(&given) {
                Ok(()) => *value = given,
                Err(reason) => errors.push(ParameterError::Value {
                    origin: found.origin.clone(),
                    name: found.name.clone(),
                    reason,
                }),
            }
        }
        if errors.is_empty() {
            self.entries = taken;
            Ok(warnings)
        } else {
            Err(errors)
        }
    }

    /// Whether ROS nodes have a parameter of this name that has no effect here.
    pub(crate) fn is_of_ros(name: &str) -> bool {
        name.starts_with("qos_overrides.") || name == "start_type_description_service"
    }

    /// Whether a running node may be given these values, all together.
    ///
    /// # Errors
    /// The first that does not fit.
    pub fn check(&self, changes: &[(String, ParameterValue)]) -> Result<(), ParameterError> {
        for (name, value) in changes {
            let Some((declared, current)) = self.entries.get(name) else {
                return Err(self.unknown(name, Origin::default()));
            };
            // Setting the present value is allowed, read-only or not: a dumped file loads again.
            if declared.read_only && value != current {
                return Err(ParameterError::ReadOnly { name: name.clone() });
            }
            declared.check(value).map_err(|reason| ParameterError::Value {
                origin: Origin::default(),
                name: name.clone(),
                reason,
            })?;
        }
        Ok(())
    }

    /// Gives a running node these values, all or none.
    ///
    /// # Errors
    /// The first that does not fit.
    pub fn set(&mut self, changes: &[(String, ParameterValue)]) -> Result<(), ParameterError> {
        self.check(changes)?;
        for (name, value) in changes {
            if let Some((_, current)) = self.entries.get_mut(name) {
                *current = value.clone();
            }
        }
        Ok(())
    }

    /// The value with the declared type, if it is an empty array, whose type the sender cannot
    /// know.
    pub(crate) fn as_meant(&self, name: &str, value: ParameterValue) -> ParameterValue {
        match self.entries.get(name) {
            Some((declared, _)) if value.is_empty_array() && declared.default.is_array() => {
                declared.default.emptied()
            }
            _ => value,
        }
    }

    /// The value of a parameter, if there is one of this name.
    pub fn get(&self, name: &str) -> Option<&ParameterValue> {
        self.entries.get(name).map(|(_, value)| value)
    }

    /// What a parameter may be.
    pub fn declared(&self, name: &str) -> Option<&Declared> {
        self.entries.get(name).map(|(declared, _)| declared)
    }

    /// All parameters in the order of their names.
    pub fn iter(&self) -> impl Iterator<Item = (&Declared, &ParameterValue)> {
        self.entries.values().map(|(declared, value)| (declared, value))
    }

    /// The present name of a parameter that had this name before.
    pub(crate) fn renamed(&self, name: &str) -> Option<&str> {
        let mut declared = self.entries.values().map(|(declared, _)| declared);
        declared.find(|it| it.formerly.as_deref() == Some(name)).map(|it| it.name.as_str())
    }

    fn unknown(&self, name: &str, origin: Origin) -> ParameterError {
        if let Some(now) = self.renamed(name) {
            return ParameterError::Renamed { origin, name: name.to_owned(), now: now.to_owned() };
        }
        let known: Vec<&str> = self.entries.keys().map(String::as_str).collect();
        ParameterError::Unknown { origin, name: name.to_owned(), known: known.join(", ") }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::USE_SIM_TIME;

    fn declared() -> Vec<Declared> {
        vec![
            Declared::new("port", "", "the serial port").read_only(),
            Declared::new("baud", 115_200, "bits per second").integer_within(1200, 4_000_000),
            Declared::new("hold_latency_ms_max", 20.0, "ms").within(1.0, 1000.0),
            Declared::new("control", "rs274", "the profile")
                .one_of(&["rs274", "masso"])
                .formerly("controller"),
            Declared::new("home_axes", Vec::<i64>::new(), "axes").integer_within(0, 5),
        ]
    }

    fn parameters() -> Parameters {
        Parameters::declare(declared()).expect("valid")
    }

    fn found(name: &str, value: impl Into<ParameterValue>) -> Override {
        Override {
            name: name.into(),
            value: Some(value.into()),
            origin: Origin("f.yaml:3".into()),
            is_shared: false,
        }
    }

    fn is_shared(found: Override) -> Override {
        Override { is_shared: true, ..found }
    }

    #[test]
    fn a_value_that_does_not_fit_is_refused_with_its_place_and_a_help() {
        let table: Vec<(Override, &str)> = vec![
            (found("hold_latency_ms_max", 5), "5 is an integer, and a double is needed: write 5.0"),
            (found("port", 5), "write \"5\" in quotes"),
            (found("use_sim_time", "si"), "write true or false"),
            (found("baud", 9600.5), "9600.5 is a double, and an integer is needed"),
            (found("hold_latency_ms_max", f64::NAN), "NaN"),
            (found("hold_latency_ms_max", f64::INFINITY), "not between 1 and 1000"),
            (found("baud", 300), "300 is not between 1200 and 4000000"),
            (found("home_axes", vec![0, 9]), "9 is not between 0 and 5"),
            (found("control", "fanuc"), "\"fanuc\" is not one of rs274, masso"),
            (found("controller", "masso"), "parameter \"controller\" is called \"control\" now"),
            (
                is_shared(found("controller", "masso")),
                "parameter \"controller\" is called \"control\" now",
            ),
            (found("prot", "/dev/ttyS0"), "not one of this node's: baud, control"),
        ];
        for (bad, part) in table {
            let mut parameters = parameters();
            let errors = parameters.apply(std::slice::from_ref(&bad)).expect_err(part);
            let text = errors[0].to_string();
            assert!(text.starts_with("f.yaml:3: ") && text.contains(part), "{text}");
            assert_eq!(parameters, self::parameters(), "nothing is taken");
        }
    }

    #[test]
    fn later_values_win_and_all_errors_are_reported_at_once() {
        let mut parameters = parameters();
        let overrides = [found("baud", 9600), found("port", "a"), found("baud", 19_200)];
        assert_eq!(parameters.apply(&overrides), Ok(vec![]));
        assert_eq!(parameters.get("baud"), Some(&ParameterValue::Integer(19_200)));
        assert_eq!(parameters.get("port"), Some(&"a".into()));
        let bad = [found("baud", 1), found("x", 1), found("control", 1)];
        assert_eq!(parameters.apply(&bad).expect_err("three").len(), 3);
    }

    #[test]
    fn a_bool_may_be_written_as_yaml_1_1_has_it() {
        for (word, expected) in [("yes", true), ("On", true), ("off", false), ("NO", false)] {
            let mut parameters = parameters();
            parameters.apply(&[found(USE_SIM_TIME, word)]).expect(word);
            assert_eq!(parameters.get(USE_SIM_TIME), Some(&expected.into()), "{word}");
        }
        // A string stays a string, even if it looks like a number.
        let mut parameters = parameters();
        parameters.apply(&[found("port", "on")]).expect("a string");
        assert_eq!(parameters.get("port"), Some(&"on".into()));
    }

    #[test]
    fn what_may_be_meant_for_others_is_only_a_warning() {
        let mut parameters = parameters();
        let shared = Override { is_shared: true, ..found("others", 1) };
        let qos = found("qos_overrides./tf.publisher.depth", 5);
        assert_eq!(parameters.apply(&[shared, qos]).expect("warnings").len(), 2);
    }

    #[test]
    fn an_empty_list_is_any_array_but_no_scalar() {
        let mut parameters = parameters();
        let empty = |name: &str| Override { value: None, ..found(name, 0) };
        assert_eq!(
            parameters.apply(&[found("home_axes", vec![1]), empty("home_axes")]),
            Ok(vec![])
        );
        assert_eq!(parameters.get("home_axes"), Some(&ParameterValue::IntegerArray(vec![])));
        // Over the network it arrives as an array of any type.
        let meant = parameters.as_meant("home_axes", Vec::<bool>::new().into());
        assert_eq!(meant, ParameterValue::IntegerArray(vec![]));
        assert_eq!(parameters.as_meant("baud", vec![true].into()), vec![true].into());
        assert!(parameters.apply(&[empty("baud")]).is_err());
        assert!(parameters.apply(&[empty("port")]).is_err());
    }

    #[test]
    fn a_running_node_takes_all_changes_or_none_and_no_read_only_one() {
        let mut parameters = parameters();
        let good = ("baud".to_owned(), ParameterValue::Integer(9600));
        let fixed = ("port".to_owned(), ParameterValue::from("b"));
        let error = parameters.set(&[good.clone(), fixed]).expect_err("read-only");
        assert!(error.to_string().contains("read-only"), "{error}");
        assert_eq!(parameters.get("baud"), Some(&ParameterValue::Integer(115_200)));
        // Setting the present value is allowed: a file of all parameters loads.
        let same = ("port".to_owned(), ParameterValue::from(""));
        parameters.set(&[good, same]).expect("fits");
        assert_eq!(parameters.get("baud"), Some(&ParameterValue::Integer(9600)));
    }

    #[test]
    fn a_declaration_is_checked_too() {
        let twice = vec![Declared::new("a", 1, ""), Declared::new("a", 2, "")];
        assert!(Parameters::declare(twice).is_err());
        let outside = vec![Declared::new("a", 1.0, "").within(2.0, 3.0)];
        assert!(Parameters::declare(outside).is_err());
        assert!(Parameters::declare(vec![Declared::new(USE_SIM_TIME, true, "")]).is_err());
        assert!(parameters().get(USE_SIM_TIME).is_some());
    }
}
