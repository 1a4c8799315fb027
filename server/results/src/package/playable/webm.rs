//! `WebM` (RFC 8794, RFC 9559): writes the duration into the segment's information.

use super::opus;

const HEADER: u32 = 0x1A45_DFA3;
const SEGMENT: u32 = 0x1853_8067;
const SEEK_HEAD: u32 = 0x114D_9B74;
const INFO: u32 = 0x1549_A966;
const CUES: u32 = 0x1C53_BB6B;
const CLUSTER: u32 = 0x1F43_B675;
const TIMESTAMP_SCALE: u32 = 0x002A_D7B1;
const DURATION: u32 = 0x4489;
const TIMESTAMP: u32 = 0xE7;
const SIMPLE_BLOCK: u32 = 0xA3;
const BLOCK_GROUP: u32 = 0xA0;
const BLOCK: u32 = 0xA1;

/// Id of an element that readers skip.
const VOID: u8 = 0xEC;

/// Nanoseconds of a tick, where the file does not say.
const USUAL_SCALE: u64 = 1_000_000;

/// An element: where its size and its content are.
#[derive(Debug, Clone, Copy)]
struct Element {
    id: u32,
    /// Place of the size.
    size_at: usize,
    /// Place of the content.
    from: usize,
    /// End of the content; `None` if the size is unknown, as in a file that is written while it is recorded.
    to: Option<usize>,
}

/// `file` with its duration; `None` if it states one, points to places that would move, or cannot be read.
pub fn with_duration(file: &[u8]) -> Option<Vec<u8>> {
    let header = element(file, 0).filter(|header| header.id == HEADER)?;
    let segment = element(file, header.to?).filter(|segment| segment.id == SEGMENT)?;
    let parts = parts(file, segment);
    // An index of places means that the file was finished; its places would be wrong.
    if parts.iter().any(|part| part.id == CUES) {
        return None;
    }

    let info = *parts.iter().find(|part| part.id == INFO)?;
    let facts = children(file, info);
    if facts.iter().any(|fact| fact.id == DURATION) {
        return None;
    }
    let scale = facts.iter().find(|fact| fact.id == TIMESTAMP_SCALE);
    let scale = scale.map_or(Some(USUAL_SCALE), |scale| number(content(file, *scale)?)).filter(|scale| *scale > 0)?;

    let clusters = parts.iter().filter(|part| part.id == CLUSTER);
    let end = clusters.filter_map(|cluster| end_of(file, *cluster, scale)).max()?;
    let ticks = end as f64 / scale as f64;

    let mut duration = vec![0x44, 0x89, 0x88];
    duration.extend(ticks.to_be_bytes());

    let mut file = file.to_vec();
    for head in parts.iter().filter(|part| part.id == SEEK_HEAD) {
        // It lists places of parts, which move now. Players find the parts without it.
        clear(&mut file, *head)?;
    }
    insert(&file, segment, info, &duration)
}

/// Makes an element one that readers skip, of the same length.
fn clear(file: &mut [u8], element: Element) -> Option<()> {
    // An id has four bytes here.
    let whole = file.get_mut(element.size_at - 4..element.to?)?;
    let content = whole.len().checked_sub(9)?;
    whole.fill(0);
    whole[0] = VOID;
    whole[1..9].copy_from_slice(&size(content));
    Some(())
}

/// `file` with `added` at the end of its `info`.
fn insert(file: &[u8], segment: Element, info: Element, added: &[u8]) -> Option<Vec<u8>> {
    let end = info.to?;
    let info_size = size(end - info.from + added.len());
    let grown = added.len() + info_size.len() - (info.from - info.size_at);

    let mut out = Vec::with_capacity(file.len() + 32);
    out.extend(file.get(..segment.size_at)?);
    match segment.to {
        Some(to) => out.extend(size(to - segment.from + grown)),
        None => out.extend(file.get(segment.size_at..segment.from)?),
    }
    out.extend(file.get(segment.from..info.size_at)?);
    out.extend(info_size);
    out.extend(file.get(info.from..end)?);
    out.extend(added);
    out.extend(file.get(end..)?);
    Some(out)
}

/// The end of the last packet in `cluster`, in nanoseconds; `None` if there is no packet.
fn end_of(file: &[u8], cluster: Element, scale: u64) -> Option<u64> {
    let inside = children(file, cluster);
    let time = inside.iter().find(|child| child.id == TIMESTAMP)?;
    let time = number(content(file, *time)?)?;

    let grouped = inside.iter().filter(|child| child.id == BLOCK_GROUP).flat_map(|group| children(file, *group));
    let blocks = inside.iter().copied().chain(grouped).filter(|child| matches!(child.id, SIMPLE_BLOCK | BLOCK));
    let end = |block: Element| {
        let content = content(file, block)?;
        // The number of the track, as long as its first bit set tells; the time in the cluster; flags; the packet.
        let after = content.first()?.leading_zeros() as usize + 1;
        let within = i16::from_be_bytes(content.get(after..after + 2)?.try_into().ok()?);
        let start = time.checked_add_signed(i64::from(within))?.checked_mul(scale)?;
        start.checked_add(opus::nanoseconds(content.get(after + 3..)?)?)
    };
    blocks.filter_map(end).max()
}

/// The parts of `segment` whose beginning can be read.
fn parts(file: &[u8], segment: Element) -> Vec<Element> {
    let mut parts = Vec::new();
    let mut at = segment.from;
    while let Some(part) = element(file, at) {
        parts.push(part);
        at = match part.to {
            Some(to) => to,
            // A cluster of unknown size ends where the next part begins.
            None => children(file, part).last().and_then(|last| last.to).unwrap_or(part.from),
        };
    }
    parts
}

/// The elements in `parent`, as far as they are whole.
fn children(file: &[u8], parent: Element) -> Vec<Element> {
    let end = parent.to.unwrap_or(file.len()).min(file.len());
    let mut children = Vec::new();
    let mut at = parent.from;
    while at < end {
        let Some(child) = element(file, at) else { break };
        // Only parts of a segment have such long ids.
        let is_next_part = parent.to.is_none() && child.id >= 0x1000_0000;
        let Some(to) = child.to.filter(|to| *to <= end && !is_next_part) else { break };
        children.push(child);
        at = to;
    }
    children
}

/// The element that begins at `at`.
fn element(file: &[u8], at: usize) -> Option<Element> {
    let first = *file.get(at)?;
    let length = first.leading_zeros() as usize + 1;
    let size_at = at + length;
    let id = file.get(at..size_at).filter(|id| id.len() <= 4)?;
    let id = id.iter().fold(0, |id, byte| (id << 8) | u32::from(*byte));

    let first = *file.get(size_at)?;
    let length = first.leading_zeros() as usize + 1;
    let from = size_at + length;
    let size = file.get(size_at..from).filter(|size| size.len() <= 8)?;
    let size = size.iter().fold(0, |size, byte| (size << 8) | u64::from(*byte)) & ((1 << (7 * length)) - 1);
    let unknown = size == (1 << (7 * length)) - 1;
    let to = if unknown { None } else { Some(from.checked_add(usize::try_from(size).ok()?)?) };
    Some(Element { id, size_at, from, to })
}

fn content(file: &[u8], element: Element) -> Option<&[u8]> {
    file.get(element.from..element.to?)
}

/// A number of up to 8 bytes.
fn number(bytes: &[u8]) -> Option<u64> {
    (bytes.len() <= 8).then(|| bytes.iter().fold(0, |number, byte| (number << 8) | u64::from(*byte)))
}

/// A size in 8 bytes, which is as long as one gets.
fn size(size: usize) -> [u8; 8] {
    (size as u64 | (1 << 56)).to_be_bytes()
}
