//! Writes TIFFs of several pages, from the specification: uncompressed, little-endian, one strip a page.

/// A file with a page of 8-bit gray for each picture of `width` pixels, and a description on the first.
pub fn pages(pictures: &[Vec<u8>], width: u32, description: &str) -> Vec<u8> {
    let mut file = b"II*\0\x08\0\0\0".to_vec();
    for (index, samples) in pictures.iter().enumerate() {
        let height = samples.len() as u32 / width;
        // A directory of 10 fields, then the description, then the samples.
        let begin = file.len() as u32;
        let text_at = begin + 2 + 10 * 12 + 4;
        let text = if index == 0 { [description.as_bytes(), b"\0\0\0\0\0"].concat() } else { vec![0; 5] };
        let samples_at = text_at + text.len() as u32;
        let next = if index + 1 == pictures.len() { 0 } else { samples_at + samples.len() as u32 };

        file.extend(10_u16.to_le_bytes());
        let fields = [
            (256_u16, 4_u16, 1, width),
            (257, 4, 1, height),
            (258, 3, 1, 8),
            (259, 3, 1, 1),
            (262, 3, 1, 1),
            (270, 2, text.len() as u32, text_at),
            (273, 4, 1, samples_at),
            (277, 3, 1, 1),
            (278, 4, 1, height),
            (279, 4, 1, samples.len() as u32),
        ];
        for (tag, kind, count, value) in fields {
            file.extend(tag.to_le_bytes());
            file.extend(kind.to_le_bytes());
            file.extend(u32::to_le_bytes(count));
            file.extend(u32::to_le_bytes(value));
        }
        file.extend(next.to_le_bytes());
        file.extend(text);
        file.extend(samples);
    }
    file
}
