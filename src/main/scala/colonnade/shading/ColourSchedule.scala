package colonnade.shading

import chisel3._
import chisel3.util.log2Ceil
import colonnade.config.PathConfig

/** The order of the slots of an operation: its surface's, light by light of each channel; then the path's,
  * one for each channel, if it is a bounce, a surface that gathers, or has no surface.
  *
  * @param lightsOn lights that are on, from the first one
  */
final private[shading] class ColourSchedule(config: PathConfig, operation: ColourOperation, lightsOn: UInt) {
  val isIssuing = RegInit(false.B)
  val channel   = Reg(UInt(2.W))
  val light     = Reg(UInt(log2Ceil(config.device.frame.lights.max(2)).W))
  val ofSurface = Reg(Bool())

  private val changesPath = operation.isBounce || operation.end.gathers
  private val isLastPass  = !(changesPath && ofSurface)
  val pass: ColourPass.Type =
    Mux(
      changesPath && !ofSurface,
      ColourPass.throughput,
      Mux(operation.isBounce, ColourPass.reflection, ColourPass.end)
    )

  val isLastLight: Bool = isLast(light)
  private val lightThen   = Mux(isLastLight, 0.U, light + 1.U)
  private val channelThen = Mux(!isLastLight, channel, Mux(channel === 2.U, 0.U, channel + 1.U))
  val isLastSlot: Bool = isIssuing && isLastPass && channel === 2.U && isLastLight
  private val endsNext = isIssuing && isLastPass && channelThen === 2.U && isLast(lightThen)

  /** The last slot is issued, or the one before. */
  val endsSoon: Bool = !isIssuing || isLastSlot || endsNext

  /** To be called once: an operation begins in the next cycle. */
  def start(begins: Bool, hasSurface: Bool): Unit = {
    assert(!begins || !isIssuing || isLastSlot, "an operation before the end of another one")
    when(isIssuing) {
      light   := lightThen
      channel := channelThen
      when(isLastLight && channel === 2.U && changesPath) { ofSurface := false.B }
    }
    when(begins) {
      isIssuing := true.B
      ofSurface := hasSurface
      channel   := 0.U
      light     := 0.U
    }.elsewhen(isLastSlot) { isIssuing := false.B }
  }

  /** An entry by light, of this slot. */
  def ofLight[T <: Data](entries: Vec[T]): T = if (config.device.frame.lights == 1) entries.head else entries(light)

  private def isLast(light: UInt): Bool = !ofSurface || light +& 1.U >= lightsOn // off, it adds nothing
}
