package colonnade.shading

import chisel3._
import chisel3.util.log2Ceil
import colonnade.common.Context
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.FrameRegisters

/** A bounce or an end in [[ColourUnit]]. */
final private[shading] class ColourOperation(config: PathConfig) extends Bundle {
  val context    = Context(config)
  val isBounce   = Bool()
  val isStraight = Bool()       // the path's throughput is 1, its radiance 0
  val end        = new ShownEnd // of the path, or of the Fresnel reflection
  val goesBack   = Bool()
  val occlusions = Vec(config.device.frame.lights, Occlusion())
  val needsRatio = Bool()

  /** What the path lets through at a bounce, and the weight of the Fresnel reflection. */
  val tint    = Option.when(config.device.frame.hasBounces)(Vec(3, FrameRegisters.weight))
  val fresnel = Option.when(config.device.frame.hasBounces)(FrameRegisters.weight)
}

/** What a slot of [[ColourUnit]] computes in a channel; the table of factors and terms is there. */
private[shading] object ColourPass extends ChiselEnum {
  val end        = Value // what a path shows where it ends, and its colour
  val reflection = Value // the surface that a Fresnel reflection shows
  val throughput = Value // the path's throughput after a bounce, or after a surface that gathers; its radiance
}

/** A channel of an operation, and a light of its surface, in the stages of [[ColourUnit]]. */
final private[shading] class ColourSlot(config: PathConfig) extends Bundle {
  val isValid    = Bool()
  val context    = Context(config)
  val pass       = ColourPass()
  val end        = new ShownEnd
  val goesBack   = Bool()
  val needsRatio = Bool()
  val isLast     = Bool() // the operation's last slot
  val channel    = UInt(2.W)

  /** The first light of the channel, the last one. */
  val isFirstLight = Bool()
  val isLastLight  = Bool()

  /** The path's radiance and throughput; the light that the surface adds. */
  val radiance = UInt(NumberFormats.colourBits.W)
  val weight   = UInt((NumberFormats.lightFraction + 1).W)
  val emission = Option.when(config.device.frame.emission)(UInt(NumberFormats.colourBits.W))

  def isIn(pass: ColourPass.Type): Bool = this.pass === pass
}

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
