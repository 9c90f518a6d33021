//! Groups blocks and elements into spans: what lies between a lead-on and the next lead-off.

use crate::blocks::program::{BlockKind, NONE, Offset};
use crate::blocks::tool_path::ToolPath;
use cnc_msgs::path::Role;
use std::ops::Range;

#[derive(Debug, Clone)]
pub(crate) struct Span {
    /// Its legs, as a range of the list of all legs.
    pub legs: Range<usize>,
    /// All its blocks, its leads included.
    pub blocks: Range<u32>,
    /// Its elements between its leads.
    pub elements: Range<usize>,
    /// The elements of its leads: before it, after it.
    pub lead_on: Option<usize>,
    pub lead_off: Option<usize>,
    /// Whether the first leg may begin, and the last end, at a change of side.
    pub from_side: bool,
    pub to_side: bool,
}

/// All spans, and all legs in order.
#[derive(Debug, Default)]
pub(crate) struct Spans {
    pub spans: Vec<Span>,
    pub legs: Vec<u32>,
}

impl Spans {
    pub(crate) fn of(tool_path: &ToolPath<'_>) -> Self {
        let mut all =
            Self { spans: Vec::new(), legs: Vec::with_capacity(tool_path.program.blocks.len()) };
        all.gather(tool_path);
        all.add_elements(tool_path);
        all.spans.retain(|span| !span.legs.is_empty());
        all
    }

    fn gather(&mut self, tool_path: &ToolPath<'_>) {
        let mut open: Option<Span> = None;
        for (index, block) in tool_path.program.blocks.iter().enumerate() {
            let number = index as u32;
            let new = |legs: usize, from_side: bool| Span {
                legs: legs..legs,
                blocks: number..number + 1,
                elements: 0..0,
                lead_on: None,
                lead_off: None,
                from_side,
                to_side: false,
            };
            match block.kind {
                BlockKind::Free => {}
                BlockKind::LeadOn => {
                    self.spans.extend(open.take());
                    open = Some(new(self.legs.len(), false));
                }
                BlockKind::LeadOff | BlockKind::Link => {
                    if let Some(mut span) = open.take() {
                        span.blocks.end = number + 1;
                        self.spans.push(span);
                    }
                    if block.kind == BlockKind::Link {
                        open = Some(new(self.legs.len(), false));
                    }
                }
                BlockKind::Leg | BlockKind::OffPlane | BlockKind::Still => {
                    if block.begins && block.kind == BlockKind::Leg {
                        if let Some(mut span) = open.take() {
                            span.to_side = true;
                            self.spans.push(span);
                        }
                        open = Some(new(self.legs.len(), true));
                    }
                    let Some(span) = &mut open else { continue };
                    span.blocks.end = number + 1;
                    if block.kind == BlockKind::Leg {
                        self.legs.push(number);
                        span.legs.end = self.legs.len();
                    }
                }
            }
        }
        self.spans.extend(open);
    }

    fn add_elements(&mut self, tool_path: &ToolPath<'_>) {
        let mut current = 0;
        for (index, (&role, &block)) in tool_path.roles.iter().zip(&tool_path.block_of).enumerate()
        {
            if block == NONE || role == Role::None {
                continue;
            }
            while self.spans.get(current).is_some_and(|span| span.blocks.end <= block) {
                current += 1;
            }
            let Some(span) = self.spans.get_mut(current) else { return };
            match role {
                Role::LeadOn => span.lead_on = Some(index),
                Role::LeadOff => span.lead_off = Some(index),
                // A link block is the last of one span and the first of the next.
                Role::Link if tool_path.program.blocks[block as usize].kind == BlockKind::Link => {
                    span.lead_off = Some(index);
                    if let Some(next) = self.spans.get_mut(current + 1) {
                        next.lead_on = Some(index);
                    }
                }
                Role::Link => {
                    span.lead_on = Some(index);
                    if let Some(before) = current.checked_sub(1) {
                        self.spans[before].lead_off = Some(index);
                    }
                }
                _ => {
                    if span.elements.is_empty() {
                        span.elements = index..index;
                    }
                    span.elements.end = index + 1;
                }
            }
        }
    }
}

impl Span {
    /// The offset of an element of it: that of its block; after the last leg, that of the last leg.
    pub(crate) fn offset<'a>(
        &self,
        tool_path: &'a ToolPath<'_>,
        legs: &[u32],
        block: u32,
    ) -> &'a Offset {
        let is_leg = tool_path.program.blocks[block as usize].kind == BlockKind::Leg;
        let last = legs[self.legs.end - 1];
        tool_path.program.offset(if is_leg { block } else { last })
    }
}
