//! Writes the URDF model as XML.

use std::io;

use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesText, Event};

use super::inertia::Inertia;
use super::model::{Joint, Limit, Link, Model, Motion, UrdfError};
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
            let material = xml.create_element("material").with_attribute(("name", name));
            material.write_inner_content(|xml| empty(xml, "color", &[("rgba", &color)]))?;
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
    element.write_inner_content(|xml| {
        inertial(xml, &Inertia::of(&link.visuals))?;
        for part in &link.visuals {
            shape(xml, "visual", part)?;
            shape(xml, "collision", part)?;
        }
        Ok(())
    })?;
    Ok(())
}

fn inertial(xml: &mut Xml, Inertia { mass, center, tensor: [x, y, z] }: &Inertia) -> io::Result<()> {
    xml.create_element("inertial").write_inner_content(|xml| {
        origin(xml, *center, [0.0; 3])?;
        xml.create_element("mass").with_attribute(("value", number(*mass).as_str())).write_empty()?;
        let terms =
            [("ixx", x[0]), ("ixy", x[1]), ("ixz", x[2]), ("iyy", y[1]), ("iyz", y[2]), ("izz", z[2])];
        let terms = terms.map(|(name, value)| (name, number(value)));
        let element = xml.create_element("inertia");
        element.with_attributes(terms.iter().map(|(name, value)| (*name, value.as_str()))).write_empty()?;
        Ok(())
    })?;
    Ok(())
}

/// Writes a shape as the element `name`, `visual` or `collision`.
fn shape(xml: &mut Xml, name: &str, shape: &Visual) -> io::Result<()> {
    xml.create_element(name).write_inner_content(|xml| {
        origin(xml, shape.origin, shape.rotation)?;
        xml.create_element("geometry").write_inner_content(|xml| match shape.geometry {
            Geometry::Box(edges) => empty(xml, "box", &[("size", &numbers(&edges))]),
            Geometry::Cylinder { radius, length } => {
                empty(xml, "cylinder", &[("radius", &number(radius)), ("length", &number(length))])
            }
        })?;
        match name {
            "visual" => empty(xml, "material", &[("name", shape.material)]),
            _ => Ok(()),
        }
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
            empty(xml, "parent", &[("link", joint.parent)])?;
            empty(xml, "child", &[("link", joint.child)])?;
            let Motion::Moves { axis, limit: limits, .. } = &joint.motion else { return Ok(()) };
            empty(xml, "axis", &[("xyz", &numbers(axis))])?;
            limit(xml, limits)
        })?;
    Ok(())
}

fn limit(xml: &mut Xml, limit: &Limit) -> io::Result<()> {
    let travel = limit.travel.into_iter().flat_map(|travel| ["lower", "upper"].into_iter().zip(travel));
    let all = travel.chain([("effort", limit.effort), ("velocity", limit.velocity)]);
    let all: Vec<(&str, String)> = all.map(|(name, value)| (name, number(value))).collect();
    let attributes: Vec<(&str, &str)> = all.iter().map(|(name, value)| (*name, value.as_str())).collect();
    empty(xml, "limit", &attributes)
}

fn origin(xml: &mut Xml, xyz: [f64; 3], rpy: [f64; 3]) -> io::Result<()> {
    empty(xml, "origin", &[("xyz", &numbers(&xyz)), ("rpy", &numbers(&rpy))])
}

/// Writes an element without content.
fn empty(xml: &mut Xml, name: &str, attributes: &[(&str, &str)]) -> io::Result<()> {
    xml.create_element(name).with_attributes(attributes.iter().copied()).write_empty()?;
    Ok(())
}

/// Returns the shortest decimal text that parses to the same number, without a sign before zero.
fn number(value: f64) -> String {
    (value + 0.0).to_string()
}

fn numbers(values: &[f64]) -> String {
    values.iter().map(|value| number(*value)).collect::<Vec<_>>().join(" ")
}
