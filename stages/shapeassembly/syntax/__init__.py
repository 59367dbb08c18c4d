"""ShapeAssembly_syntax:_the_program_tree,_its_text_and_its_rules."""
