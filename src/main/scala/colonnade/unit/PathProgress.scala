package colonnade.unit

import chisel3._
import chisel3.util.{log2Ceil, PriorityEncoder, RegEnable, Valid}
import colonnade.common.{Choice, Context}
import colonnade.config.PathConfig
import colonnade.formats.Gather
import colonnade.shading.Occlusion

/** What [[RtController]] knows of the rays that the path of each context gathered: none. [[GatheringPaths]] is for a
  * device with gathered light.
  */
private[unit] class GatherProgress {
  def isBuilt: Bool = false.B // contexts may gather
  def isOn: Bool    = false.B // in this frame

  /** The path has gathered. It meets the light cube, not the environment. */
  def hasGathered(context: UInt): Bool = false.B

  /** The surface at which the path ends may gather; it is of the environment, or may be, if the camera sees it. */
  def mayGather(choice:       Choice): Bool = false.B
  def isOfEnvironment(choice: Choice): Bool = true.B

  /** The shadow rays of a point of the environment before it gathered, given its path's. */
  def before(choice: Choice, occlusions: Seq[Occlusion.Type]): Seq[Occlusion.Type] = occlusions

  /** Each to be called once: a path starts; a surface is known; its gathered ray is issued, after its shadow rays. */
  def start(valid:  Bool, context: UInt): Unit                                       = ()
  def shade(shaded: Shaded, valid: Bool): Unit                                       = ()
  def issue(valid:  Bool, choice:  Choice, occlusions: => Seq[Occlusion.Type]): Unit = ()
}

/** With gathered light. */
final private class GatheringPaths(config: PathConfig, io: GatherControl) extends GatherProgress {
  private val isScattered = Reg(Vec(config.contexts, Bool()))
  private val count       = new FlagTable(config, UInt(Gather.countBits.W))

  /** With an environment: the surface is of it; what the shadow rays of a point met, while its gathered rays are
    * traced.
    */
  private val ofEnvironment = Option.when(config.device.hasEnvironment)(new FlagTable(config, Bool()))
  private val results       = Vec(config.device.frame.lights, UInt(Occlusion.getWidth.W))
  private val kept          = Option.when(config.device.hasEnvironment)(new FlagTable(config, UInt(results.getWidth.W)))

  // In the cycle after its request, the rays that a path has gathered
  private val sampled = Choice(RegEnable(io.sample, io.sample.valid), io.sample)
  io.count := Mux(RegEnable(isScattered(io.sample.bits), io.sample.valid), count.read(sampled), 0.U)

  override def isBuilt: Bool = true.B
  override def isOn: Bool    = io.bounces =/= 0.U

  override def hasGathered(context: UInt): Bool = isScattered(context)

  override def mayGather(choice: Choice): Bool =
    Mux(isScattered(choice.now.bits), count.read(choice) < io.bounces, isOn)

  override def isOfEnvironment(choice: Choice): Bool = ofEnvironment.map(_.read(choice).asBool).getOrElse(false.B)

  override def before(choice: Choice, occlusions: Seq[Occlusion.Type]): Seq[Occlusion.Type] =
    kept.fold(occlusions)(_.read(choice).asTypeOf(results).map(Occlusion.safe(_)._1))

  override def start(valid: Bool, context: UInt): Unit = when(valid) { isScattered(context) := false.B }

  override def shade(shaded: Shaded, valid: Bool): Unit =
    ofEnvironment.foreach(_.write(valid, shaded.context, shaded.isOfEnvironment))

  override def issue(valid: Bool, choice: Choice, occlusions: => Seq[Occlusion.Type]): Unit = {
    val context = choice.now.bits
    val isFirst = !isScattered(context)
    count.write(valid, context, Mux(isFirst, 1.U, count.read(choice) + 1.U))
    kept.foreach(_.write(valid && isFirst, context, VecInit(occlusions).asUInt))
    when(valid) { isScattered(context) := true.B }
  }
}

private[unit] object GatherProgress {
  def apply(config: PathConfig, io: Option[GatherControl]): GatherProgress =
    io.fold(new GatherProgress)(new GatheringPaths(config, _))
}

/** What [[RtController]] knows of the shadow rays of each context. They follow the lights by their number.
  *
  * Nothing is reset: the results of lights that need no shadow ray are ignored.
  */
private[unit] final class ShadowProgress(config: PathConfig) {
  private val lights = config.device.frame.lights

  private val needs   = new FlagTable(config, UInt(lights.W))
  private val current = new FlagTable(config, UInt(log2Ceil(lights.max(2)).W))
  private val results = Seq.fill(lights)(new FlagTable(config, UInt(Occlusion.getWidth.W)))

  /** A surface is known, and the lights that it needs a shadow ray to. */
  def begin(valid: Bool, context: UInt, lights: UInt): Unit = needs.write(valid, context, lights)

  /** The light of the next shadow ray. */
  def next(choice: Choice, isFirst: Bool): UInt = {
    val needed = needs.read(choice)
    val after  = current.read(choice)
    PriorityEncoder(needed.asBools.zipWithIndex.map { case (needs, light) => needs && (isFirst || after < light.U) })
  }

  /** A shadow ray is traced. */
  def trace(valid: Bool, context: UInt, light: UInt): Unit = current.write(valid, context, light)

  /** A shadow ray has ended.
    *
    * @return whether lights are left
    */
  def end(valid: Bool, choice: Choice, occlusion: Occlusion.Type): Bool = {
    val needed = needs.read(choice)
    val light  = current.read(choice)
    for ((result, number) <- results.zipWithIndex)
      result.write(valid && light === number.U, choice.now.bits, occlusion.asUInt)
    VecInit(needed.asBools.zipWithIndex.map { case (needs, number) => needs && light < number.U }).asUInt.orR
  }

  /** The results, by light. */
  def occlusions(choice: Choice): Seq[Occlusion.Type] = {
    val needed = needs.read(choice)
    results.zipWithIndex.map { case (result, light) =>
      Mux(needed(light), Occlusion.safe(result.read(choice))._1, Occlusion.none)
    }
  }
}

/** Flags of each context, written by one writer and read with choices: registers; or, of many contexts, a memory for
  * each reader, since a choice is then known a cycle before.
  */
private[unit] final class FlagTable(config: PathConfig, flags: UInt) {
  private val contexts  = config.contexts
  private val registers = Option.unless(config.isLarge)(Reg(Vec(contexts, flags)))
  private val written   = Wire(Valid(flags))
  private val writer    = Wire(Context(config))
  registers.foreach(table => when(written.valid) { table(writer) := written.bits })

  /** To be called once. */
  def write(valid: Bool, context: UInt, value: UInt): Unit = {
    written.valid := valid
    written.bits  := value
    writer        := context
  }

  /** The flags of the context that is chosen now. */
  def read(choice: Choice): UInt = registers.map(_(choice.now.bits)).getOrElse {
    val memory = SyncReadMem(contexts, flags)
    when(written.valid) { memory.write(writer, written.bits) }
    memory.read(choice.following.bits, choice.following.valid)
  }
}
