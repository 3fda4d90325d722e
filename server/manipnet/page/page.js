document.title = "ManipNet Live";
