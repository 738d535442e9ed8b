"""The actions of menus, toolbar and keys, with their dialogs."""
