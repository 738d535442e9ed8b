"""The commands of menus, toolbar and keys, with their dialogs."""
