DROP TABLE voice_pieces;
