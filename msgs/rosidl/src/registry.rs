//! All definitions together: those of the files and those that ROS derives.
//!
//! Knows what a service and an action become on the wire. Checks that every named type
//! exists and that none contains itself.

use std::collections::BTreeMap;

use crate::definition::{Definition, DefinitionRole, FieldDefinition};
use crate::interface_error::InterfaceError;
use crate::interface_file::{InterfaceFile, Section};
use crate::name::{InterfaceKind, TypeName};

/// Definitions, sorted by full name.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Registry {
    definitions: BTreeMap<String, Definition>,
}

impl Registry {
    /// Reads all files, derives what belongs to them, and checks the types that they name.
    ///
    /// # Errors
    /// Everything that is wrong, in the order of the files.
    pub fn from_files(files: &[InterfaceFile]) -> Result<Self, Vec<InterfaceError>> {
        Self::read(files)?.checked()
    }

    /// Reads all files and derives what belongs to them.
    ///
    /// A name with an underscore is read as a derived type whose text is given, as schema texts
    /// have it. Source files have none.
    ///
    /// # Errors
    /// Every line that is wrong, in the order of the files.
    pub fn read(files: &[InterfaceFile]) -> Result<Self, Vec<InterfaceError>> {
        let mut registry = Self::default();
        let mut refusals = Vec::new();
        for file in files {
            if let Err(more) = registry.add_file(file) {
                refusals.extend(more);
            }
        }
        if refusals.is_empty() { Ok(registry) } else { Err(refusals) }
    }

    /// Checks that every type that is named exists, and that none contains itself.
    ///
    /// # Errors
    /// Every field whose type does not exist; if there is none, every type that contains itself.
    pub fn checked(self) -> Result<Self, Vec<InterfaceError>> {
        let refusals = self.check();
        if refusals.is_empty() { Ok(self) } else { Err(refusals) }
    }

    /// The definition of a type.
    pub fn get(&self, name: &TypeName) -> Option<&Definition> {
        self.definitions.get(&name.to_string())
    }

    /// The definition of a type that is known to exist.
    pub fn expect(&self, name: &TypeName) -> &Definition {
        self.get(name).unwrap_or_else(|| panic!("{name} was checked to exist"))
    }

    /// All definitions, in the order of their names.
    pub fn iter(&self) -> impl Iterator<Item = &Definition> {
        self.definitions.values()
    }

    fn insert(&mut self, definition: Definition) {
        self.definitions.insert(definition.name.to_string(), definition);
    }

    fn add_file(&mut self, file: &InterfaceFile) -> Result<(), Vec<InterfaceError>> {
        let name = &file.name;
        let is_derived = name.name.contains('_');
        let sections = file.sections();
        match (name.kind, &sections[..]) {
            (kind, [whole]) if kind == InterfaceKind::Msg || is_derived => {
                self.insert(whole.read(name.clone())?);
            }
            (kind, [request, response]) if kind == InterfaceKind::Srv || is_derived => {
                self.add_service(name, &file.text, *request, *response)?;
            }
            (InterfaceKind::Action, [goal, result, feedback]) => {
                self.add_action(file, *goal, *result, *feedback)?;
            }
            (kind, sections) => {
                let wanted = match kind {
                    InterfaceKind::Msg => 0,
                    InterfaceKind::Srv => 1,
                    InterfaceKind::Action => 2,
                };
                let message = format!(
                    "a .{} file has {wanted} lines of ---, not {}",
                    kind.folder(),
                    sections.len() - 1
                );
                return Err(vec![InterfaceError { file: file.path.clone(), line: 0, message }]);
            }
        }
        Ok(())
    }

    /// Request, response, event, and the service as a whole.
    fn add_service(
        &mut self,
        name: &TypeName,
        text: &str,
        request: Section<'_>,
        response: Section<'_>,
    ) -> Result<(), Vec<InterfaceError>> {
        let request = request.read(name.derived("_Request"))?;
        let mut response = response.read(name.derived("_Response"))?;
        if response.doc.is_empty() {
            response.doc = vec![format!("The answer of `{name}`.")];
        }
        let of = &name.name;
        let event = format!(
            "service_msgs/ServiceEventInfo info\n{of}_Request[<=1] request\n{of}_Response[<=1] response\n"
        );
        let mut event = derived(&request.file, &event).read(name.derived("_Event"))?;
        event.role = DefinitionRole::Event;
        let parts = ["request_message", "response_message", "event_message"];
        let fields = [&request, &response, &event]
            .iter()
            .zip(parts)
            .map(|(part, field)| FieldDefinition::derived(field, part.name.clone()))
            .collect();
        self.insert(Definition {
            name: name.clone(),
            role: DefinitionRole::Service,
            doc: request.doc.clone(),
            fields,
            constants: Vec::new(),
            text: text.into(),
            file: request.file.clone(),
        });
        self.insert(request);
        self.insert(response);
        self.insert(event);
        Ok(())
    }

    /// Goal, result, feedback, the messages that carry them, and the action as a whole.
    fn add_action(
        &mut self,
        file: &InterfaceFile,
        goal: Section<'_>,
        result: Section<'_>,
        feedback: Section<'_>,
    ) -> Result<(), Vec<InterfaceError>> {
        const GOAL_ID: &str = "unique_identifier_msgs/UUID goal_id\n";
        let name = &file.name;
        let of = &name.name;
        let goal = goal.read(name.derived("_Goal"))?;
        let mut result = result.read(name.derived("_Result"))?;
        let mut feedback = feedback.read(name.derived("_Feedback"))?;
        for (part, what) in [(&mut result, "The result"), (&mut feedback, "The feedback")] {
            if part.doc.is_empty() {
                part.doc = vec![format!("{what} of `{name}`.")];
            }
        }

        let services = [
            (
                "_SendGoal",
                format!("{GOAL_ID}{of}_Goal goal\n"),
                "bool accepted\nbuiltin_interfaces/Time stamp\n".to_string(),
            ),
            ("_GetResult", GOAL_ID.to_string(), format!("int8 status\n{of}_Result result\n")),
        ];
        for (suffix, request, response) in &services {
            self.add_service(
                &name.derived(suffix),
                &format!("{request}---\n{response}"),
                derived(&file.path, request),
                derived(&file.path, response),
            )?;
        }
        let message = format!("{GOAL_ID}{of}_Feedback feedback\n");
        let message = derived(&file.path, &message).read(name.derived("_FeedbackMessage"))?;

        let fields = [
            ("goal", "_Goal"),
            ("result", "_Result"),
            ("feedback", "_Feedback"),
            ("send_goal_service", "_SendGoal"),
            ("get_result_service", "_GetResult"),
            ("feedback_message", "_FeedbackMessage"),
        ]
        .map(|(field, suffix)| FieldDefinition::derived(field, name.derived(suffix)));
        self.insert(Definition {
            name: name.clone(),
            role: DefinitionRole::Action,
            doc: goal.doc.clone(),
            fields: fields.into(),
            constants: Vec::new(),
            text: file.text.clone(),
            file: file.path.clone(),
        });
        for part in [goal, result, feedback, message] {
            self.insert(part);
        }
        Ok(())
    }

    fn check(&self) -> Vec<InterfaceError> {
        let mut refusals = Vec::new();
        for definition in self.iter() {
            for (field, name) in definition.references() {
                if self.get(name).is_none() {
                    refusals.push(InterfaceError {
                        file: definition.file.clone(),
                        line: field.line,
                        message: format!("{} is a {name}, which no file defines", field.name),
                    });
                }
            }
        }
        if refusals.is_empty() {
            refusals.extend(self.iter().filter_map(|definition| self.check_finite(definition)));
        }
        refusals
    }

    /// Refuses a type that contains itself through its fields.
    fn check_finite(&self, root: &Definition) -> Option<InterfaceError> {
        let mut seen = Vec::new();
        let mut queue: Vec<(&FieldDefinition, &TypeName)> = root.references().collect();
        let origin = queue.clone();
        while let Some((_, name)) = queue.pop() {
            if *name == root.name {
                return Some(InterfaceError {
                    file: root.file.clone(),
                    line: origin.first().map_or(0, |(field, _)| field.line),
                    message: format!("{} contains itself", root.name),
                });
            }
            if !seen.contains(&name) {
                seen.push(name);
                queue.extend(self.expect(name).references());
            }
        }
        None
    }
}

/// Text that is in no file, with the file that it is derived from.
fn derived<'a>(file: &'a str, text: &'a str) -> Section<'a> {
    Section { file, first_line: 0, text }
}
