"""Publishing: a finished, verified dataset in an object store, on Hugging Face or in another folder."""
