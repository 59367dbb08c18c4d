"""Point clouds from files: tables of numbers as people write them, arrays, PCD, PTX and PLY."""
