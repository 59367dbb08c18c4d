"""The compiled ground of every method: layout of shapes in arrays, tables of a kit, admitted neighbourhoods."""
