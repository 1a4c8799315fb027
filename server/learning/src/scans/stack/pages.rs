//! Focal stacks in one file: a TIFF with a page for each position of focus, plain, or as OME or ImageJ write it.

use std::path::Path;

use crate::LearningError;
use parfocal_base::notices::tell;
use parfocal_devices::camera::footage::WideSamples;
use parfocal_imaging::{PictureFile, Reconstructor, in_blocks};

use super::plane::Plane;
use super::positions::{file_name, listed};

/// The order of pages in focus, and the position of each.
#[derive(Debug, Clone, PartialEq)]
struct Depth {
    /// The page, from 0, of each plane.
    pages: Vec<usize>,
    /// The position of each plane.
    positions: Vec<f64>,
    /// Where that comes from, for people.
    source: String,
}

/// Reads the pages of the file at `path`, made smaller by blocks of `scale` x `scale` pixels. Positions are those of
/// `list` (lines of `page,position`, pages counted from 1), else what the file says, else the order of the pages.
/// Samples that fill 16 bit are numbers of so many `bits`, as for [`super::FocalStack::load`].
///
/// # Errors
/// If a page or the list cannot be read, the pages vary in more than focus, or a sample needs more bits.
pub(super) fn planes(
    path: &Path,
    list: Option<&Path>,
    scale: usize,
    bits: Option<u8>,
) -> Result<Vec<Plane>, LearningError> {
    let unusable = |error| LearningError::of(path, error);
    let bytes = std::fs::read(path).map_err(|error| LearningError::unreadable(path, &error))?;
    let file = PictureFile::open(&bytes).map_err(unusable)?;

    let depth = match list {
        Some(list) => of_list(list, file.pages())?,
        None => depth(&file.description().unwrap_or_default(), file.pages())
            .map_err(|reason| LearningError::of(path, reason))?,
    };
    if file.pages() > 1 {
        tell(format_args!("note: {} has {} pages: {}", path.display(), file.pages(), depth.source));
    }

    let mut wide = WideSamples::default();
    depth.pages.iter().try_for_each(|&page| wide.see(path, &file, page)).map_err(unusable)?;
    let file = file.with_bits(wide.settle(path, bits)?);

    let name = file_name(path);
    let mut reconstructor = Reconstructor::default();
    let placed = depth.pages.iter().zip(&depth.positions);
    placed
        .map(|(&page, &position)| {
            let gray = file.read(page, false).map_err(unusable)?.into_gray(&mut reconstructor);
            let name = format!("page {} of {name}", page + 1);
            Ok(Plane { name, position, picture: in_blocks(&gray, scale) })
        })
        .collect()
}

fn of_list(list: &Path, count: usize) -> Result<Depth, LearningError> {
    let mut pages = Vec::new();
    let mut positions = Vec::new();
    for (name, position) in listed(list)? {
        let page = name.parse::<usize>().ok().filter(|page| (1..=count).contains(page));
        let wrong = || LearningError::of(list, format!("'{name}' must be the number of a page, from 1 to {count}"));
        pages.push(page.ok_or_else(wrong)? - 1);
        positions.push(position);
    }
    let source = format!("positions of {}", list.display());
    Ok(Depth { pages, positions, source })
}

/// The depth that a file's description gives to its `count` pages.
fn depth(description: &str, count: usize) -> Result<Depth, String> {
    if start_tags(description, "OME").next().is_some() {
        return of_ome(description, count);
    }
    if description.starts_with("ImageJ=") {
        return of_image_j(description, count);
    }
    Ok(evenly((0..count).collect(), 1.0, "taken in their order".to_owned()))
}

fn evenly(pages: Vec<usize>, step: f64, source: String) -> Depth {
    let positions = (0..pages.len()).map(|plane| plane as f64 * step).collect();
    Depth { pages, positions, source }
}

/// Refuses pages that differ in more than focus. `depths` is the number of positions.
fn only_focus(depths: usize, channels: usize, times: usize, count: usize) -> Result<(), String> {
    if channels.saturating_mul(times) > 1 && depths > 1 {
        return Err(format!(
            "it has {depths} positions, {channels} channels and {times} times, but a focal stack varies only in \
             focus; save one channel at one time"
        ));
    }
    let described = depths.saturating_mul(channels).saturating_mul(times);
    if described != count {
        return Err(format!("it describes {described} pages, but {count} can be read; save them all in one file"));
    }
    Ok(())
}

/// ImageJ's lines of `key=value`.
fn of_image_j(description: &str, count: usize) -> Result<Depth, String> {
    let value =
        |key: &str| description.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix('=')).map(str::trim);
    let number = |key| value(key).and_then(|text| text.parse::<usize>().ok());

    let channels = number("channels").unwrap_or(1);
    let times = number("frames").unwrap_or(1);
    let images = number("images").unwrap_or(1);
    let depths = number("slices").unwrap_or(if channels.max(times) > 1 { 1 } else { images });
    only_focus(depths, channels, times, count)?;

    let pages = (0..count).collect();
    let spacing =
        value("spacing").and_then(|text| text.parse::<f64>().ok()).filter(|step| step.is_finite() && *step > 0.0);
    let unit = value("unit").unwrap_or("units").replace("\\u00B5", "µ");
    Ok(match spacing {
        Some(step) => evenly(pages, step, format!("{step} {unit} apart, as ImageJ wrote")),
        None => evenly(pages, 1.0, "in ImageJ's order".to_owned()),
    })
}

/// The metadata of the *OME data model*: the first `Pixels` and its planes.
fn of_ome(xml: &str, count: usize) -> Result<Depth, String> {
    let images = start_tags(xml, "Image").count();
    if images > 1 {
        return Err(format!("it describes {images} pictures (OME); save the focal stack alone"));
    }
    let pixels = start_tags(xml, "Pixels").next().unwrap_or_default();
    let size = |name: &str| attribute::<usize>(pixels, name).unwrap_or(1);

    // Colour counts as channels that share a page.
    let shared = start_tags(xml, "Channel").next().and_then(|tag| attribute::<usize>(tag, "SamplesPerPixel"));
    let channels = size("SizeC") / shared.unwrap_or(1).max(1);
    only_focus(size("SizeZ"), channels.max(1), size("SizeT"), count)?;

    let mut pages: Vec<usize> = (0..count).collect();
    for tag in start_tags(xml, "TiffData") {
        let first =
            ["FirstZ", "FirstC", "FirstT"].iter().find_map(|name| attribute::<usize>(tag, name).filter(|at| *at > 0));
        let page = attribute::<usize>(tag, "IFD");
        if let (Some(page), planes) = (page, attribute::<usize>(tag, "PlaneCount").unwrap_or(1)) {
            for index in 0..planes.min(count) {
                let plane = first.unwrap_or(0).saturating_add(index);
                let page = page.saturating_add(index);
                if plane >= count || page >= count {
                    return Err(format!("it describes plane {} on page {}, of {count}", plane + 1, page + 1));
                }
                pages[plane] = page;
            }
        }
    }

    let unit = attribute::<String>(pixels, "PhysicalSizeZUnit").unwrap_or_else(|| "µm".to_owned());
    let unit = unit.replace("&#181;", "µ").replace("&#xB5;", "µ");
    let step = attribute::<f64>(pixels, "PhysicalSizeZ").filter(|step| step.is_finite() && *step > 0.0);
    Ok(match step {
        Some(step) => evenly(pages, step, format!("{step} {unit} apart, as its OME metadata say")),
        None => evenly(pages, 1.0, "in the order of its OME metadata".to_owned()),
    })
}

/// What follows the names of the elements `name` in their start tags, with or without a prefix.
fn start_tags<'a>(xml: &'a str, name: &'a str) -> impl Iterator<Item = &'a str> {
    xml.split('<').skip(1).filter_map(move |tag| {
        let tag = tag.split('>').next()?;
        let word = tag.split(|end: char| end.is_whitespace() || end == '/').next()?;
        let bare = word.rsplit(':').next()?;
        (bare == name).then(|| &tag[word.len()..])
    })
}

/// The value of an attribute in a start tag.
fn attribute<T: std::str::FromStr>(tag: &str, name: &str) -> Option<T> {
    let mut rest = tag;
    while let Some((before, after)) = rest.split_once('=') {
        let after = after.trim_start();
        let quote = after.chars().next().filter(|quote| matches!(quote, '"' | '\''))?;
        let (value, following) = after[1..].split_once(quote)?;
        if before.trim() == name {
            return value.trim().parse().ok();
        }
        rest = following;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_are_those_that_the_file_gives() {
        let image_j = "ImageJ=1.54f\nimages=3\nslices=3\nunit=\\u00B5m\nspacing=0.5\nloop=false\n";
        let found = depth(image_j, 3).unwrap();
        assert_eq!((found.positions, found.source.as_str()), (vec![0.0, 0.5, 1.0], "0.5 µm apart, as ImageJ wrote"));

        let ome = r#"<?xml version="1.0"?><OME xmlns="x"><Image ID="Image:0"><Pixels SizeX='9' SizeZ="3" SizeC="1"
            SizeT="1" PhysicalSizeZ="2.5" PhysicalSizeZUnit="&#181;m"><Channel SamplesPerPixel="1"/>
            <TiffData FirstZ="0" IFD="2"/><TiffData FirstZ="1" IFD="1"/><TiffData FirstZ="2" IFD="0"/>
            </Pixels></Image></OME>"#;
        let found = depth(ome, 3).unwrap();
        assert_eq!((found.pages, found.positions), (vec![2, 1, 0], vec![0.0, 2.5, 5.0]));
        assert_eq!(found.source, "2.5 µm apart, as its OME metadata say");

        assert_eq!(depth("a description", 2).unwrap().positions, [0.0, 1.0]);
        // Many save a focal stack as a film.
        assert_eq!(depth("ImageJ=1.54f\nimages=2\nframes=2\n", 2).unwrap().pages, [0, 1]);
    }

    #[test]
    fn what_varies_in_more_than_focus_is_refused_with_numbers() {
        let refused = |text: &str, count| depth(text, count).unwrap_err();
        let hyperstack = "ImageJ=1.54f\nimages=12\nchannels=2\nslices=3\nframes=2\nhyperstack=true\n";
        assert!(refused(hyperstack, 12).starts_with("it has 3 positions, 2 channels and 2 times"));
        assert!(refused("ImageJ=1.54f\nimages=300\nslices=300\n", 1).starts_with("it describes 300 pages, but 1"));
        let ome = |inside: &str| format!("<OME><Image><Pixels {inside}/></Image></OME>");
        assert!(refused(&ome(r#"SizeZ="3" SizeT="4""#), 12).contains("1 channels and 4 times"));
        assert!(refused(&ome(r#"SizeZ="9""#), 3).starts_with("it describes 9 pages, but 3 can be read"));
        assert!(refused(&(ome("") + "<OME><Image/></OME>"), 1).contains("2 pictures"));
    }
}
