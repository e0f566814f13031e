//! Writes the URDF model as XML.

use std::io;

use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesText, Event};

use super::UrdfError;
use super::model::{Joint, Limit, Link, Model, Motion};
use super::shapes::{Geometry, MATERIALS, Visual};

type Xml<'a> = Writer<&'a mut Vec<u8>>;

/// Comment at the top of the file.
const REMARK: &str = " Written by `virtual_axes urdf` from the machine file: m, rad, s, N, N m. Signs are those of ISO \
                      841: a positive joint moves the tool relative to the workpiece, so the tables turn the other way. ";

/// Returns the document as text.
pub(super) fn written(model: &Model) -> Result<String, UrdfError> {
    check("machine's name", &model.name)?;
    for joint in &model.joints {
        check("joint", &joint.name)?;
    }
    let mut text = Vec::new();
    document(&mut Writer::new_with_indent(&mut text, b' ', 2), model)?;
    text.push(b'\n');
    String::from_utf8(text).map_err(|error| UrdfError::Write(io::Error::other(error)))
}

/// Rejects a text with a character that XML 1.0 cannot represent.
fn check(what: &'static str, text: &str) -> Result<(), UrdfError> {
    match text.chars().find(|c| c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}')) {
        Some(character) => Err(UrdfError::NotXml { what, text: text.to_owned(), character }),
        None => Ok(()),
    }
}

fn document(xml: &mut Xml, model: &Model) -> io::Result<()> {
    xml.write_event(Event::Decl(BytesDecl::new("1.0", None, None)))?;
    xml.write_event(Event::Comment(BytesText::new(REMARK)))?;
    xml.create_element("robot").with_attribute(("name", model.name.as_str())).write_inner_content(|xml| {
        for (name, color) in MATERIALS {
            let color = numbers(&color);
            xml.create_element("material").with_attribute(("name", name)).write_inner_content(|xml| {
                xml.create_element("color").with_attribute(("rgba", color.as_str())).write_empty()?;
                Ok(())
            })?;
        }
        model.links.iter().try_for_each(|part| link(xml, part))?;
        model.joints.iter().try_for_each(|part| joint(xml, part))
    })?;
    Ok(())
}

fn link(xml: &mut Xml, link: &Link) -> io::Result<()> {
    let element = xml.create_element("link").with_attribute(("name", link.name));
    if link.visuals.is_empty() {
        element.write_empty()?;
        return Ok(());
    }
    element.write_inner_content(|xml| link.visuals.iter().try_for_each(|part| visual(xml, part)))?;
    Ok(())
}

fn visual(xml: &mut Xml, visual: &Visual) -> io::Result<()> {
    xml.create_element("visual").write_inner_content(|xml| {
        origin(xml, visual.origin, visual.rotation)?;
        xml.create_element("geometry").write_inner_content(|xml| {
            match visual.geometry {
                Geometry::Box(edges) => xml
                    .create_element("box")
                    .with_attribute(("size", numbers(&edges).as_str()))
                    .write_empty()?,
                Geometry::Cylinder { radius, length } => xml
                    .create_element("cylinder")
                    .with_attribute(("radius", number(radius).as_str()))
                    .with_attribute(("length", number(length).as_str()))
                    .write_empty()?,
            };
            Ok(())
        })?;
        xml.create_element("material").with_attribute(("name", visual.material)).write_empty()?;
        Ok(())
    })?;
    Ok(())
}

fn joint(xml: &mut Xml, joint: &Joint) -> io::Result<()> {
    let kind = match joint.motion {
        Motion::Fixed => "fixed",
        Motion::Moves { kind, .. } => kind,
    };
    xml.create_element("joint")
        .with_attribute(("name", joint.name.as_str()))
        .with_attribute(("type", kind))
        .write_inner_content(|xml| {
            origin(xml, joint.origin, [0.0; 3])?;
            xml.create_element("parent").with_attribute(("link", joint.parent)).write_empty()?;
            xml.create_element("child").with_attribute(("link", joint.child)).write_empty()?;
            if let Motion::Moves { axis, limit: limits, .. } = &joint.motion {
                xml.create_element("axis").with_attribute(("xyz", numbers(axis).as_str())).write_empty()?;
                limit(xml, limits)?;
            }
            Ok(())
        })?;
    Ok(())
}

fn limit(xml: &mut Xml, limit: &Limit) -> io::Result<()> {
    let mut element = xml.create_element("limit");
    if let Some([lower, upper]) = limit.travel {
        element = element
            .with_attribute(("lower", number(lower).as_str()))
            .with_attribute(("upper", number(upper).as_str()));
    }
    element
        .with_attribute(("effort", number(limit.effort).as_str()))
        .with_attribute(("velocity", number(limit.velocity).as_str()))
        .write_empty()?;
    Ok(())
}

fn origin(xml: &mut Xml, xyz: [f64; 3], rpy: [f64; 3]) -> io::Result<()> {
    xml.create_element("origin")
        .with_attribute(("xyz", numbers(&xyz).as_str()))
        .with_attribute(("rpy", numbers(&rpy).as_str()))
        .write_empty()?;
    Ok(())
}

/// Returns the shortest decimal text that parses to the same number, without a sign before zero.
fn number(value: f64) -> String {
    (value + 0.0).to_string()
}

fn numbers(values: &[f64]) -> String {
    values.iter().map(|value| number(*value)).collect::<Vec<_>>().join(" ")
}
