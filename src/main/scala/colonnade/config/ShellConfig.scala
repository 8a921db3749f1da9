package colonnade.config

/** The AXI4 shell around the device.
  *
  * @param busBytes    data of the AXI4 master
  * @param rows        tile rows that gather pixels for the framebuffer at a time, in each column
  * @param pixelStream an AXI4-Stream port, to which a frame can go instead of the framebuffer
  * @param refit       a unit that bends meshes, and an AXI4 master for it
  */
final case class ShellConfig(busBytes: Int, rows: Int = 16, pixelStream: Boolean = false, refit: Boolean = false) {
  Require.oneOf("--axi", busBytes, Seq(4, 8, 16, 32, 64, 128))
  if (refit) Require.oneOf("--axi with --refit", busBytes, Seq(4, 8, 16, 32, 64))
  Require.oneOf("rows", rows, Seq(2, 4, 8, 16, 32))
}
