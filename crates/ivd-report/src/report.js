for (const s of document.querySelectorAll('.slider')) {
  const range = s.querySelector('input');
  const cut = () => s.style.setProperty('--cut', range.value + '%');
  range.addEventListener('input', cut);
  cut();
}
