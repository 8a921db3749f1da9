package colonnade.unit

import chisel3._
import chisel3.util.{Decoupled, RegEnable, Valid}
import colonnade.common.{Context, ContextTable}
import colonnade.config.ColonnadeConfig
import colonnade.environment.RememberedRay
import colonnade.formats.Shading
import colonnade.ray.RayRequest
import colonnade.shading.{BounceResult, BouncedRay, PathTurn}

/** What a room adds to [[PathTurns]]. */
final class RoomTurns(config: ColonnadeConfig) extends Bundle {

  /** There is a room in this frame. */
  val isThere = Input(Bool())

  /** A context whose path waits until it is known what lies beside it; and one whose path may turn. */
  val aside  = Valid(Context(config))
  val resume = Flipped(Decoupled(new PathAside(config)))

  /** The ray beside a path, or the one that a path goes on with. */
  val ray = Valid(new RememberedRay(config))
}

/** Ports of [[PathTurns]]. */
final class PathTurnsIO(config: ColonnadeConfig) extends Bundle {
  val shading = Input(new Shading(config))

  /** A context takes a new pixel. */
  val begins = Flipped(Valid(Context(config)))

  /** From the shader, to the colour unit and to ray set-up. */
  val bounced = Flipped(Decoupled(new BouncedRay(config)))
  val turn    = Decoupled(new PathTurn(config))
  val ray     = Decoupled(new RayRequest(config))

  /** A path has turned. */
  val turned       = Valid(new Bounced(config))
  val isRefraction = Output(Bool())
  val room         = if (config.hasRoom) Some(new RoomTurns(config)) else None
}

/** Turns paths at mirrors and glass: the colour unit gets what becomes of the path's weight, and the ray that goes on is
  * traced as long as there are bounces left. Both in the same cycle, or neither.
  *
  * In a room, what glass reflects is met before the path turns: the reflection takes the context, and all that the turn
  * needs waits in a table. Turns out of the table go first; they come three cycles after their context is named.
  */
final class PathTurns(config: ColonnadeConfig) extends Module {
  val io = IO(new PathTurnsIO(config))

  private val direct = Wire(new TurnedPath(config))
  private val bounce = io.bounced.bits.bounce
  direct.turn.context  := bounce.context
  direct.turn.albedo   := io.bounced.bits.albedo
  direct.turn.isTinted := io.bounced.bits.isTinted
  direct.turn.share    := bounce.share
  direct.turn.hasSurface.foreach(_ := false.B)
  direct.isRefraction := bounce.isRefraction
  direct.origin       := bounce.origin
  direct.towards      := bounce.towards

  // The path that turns
  private val path = Wire(Decoupled(new TurnedPath(config)))
  path.valid       := io.bounced.valid
  path.bits        := direct
  io.bounced.ready := path.ready
  for (room <- io.room) waitBeside(room)

  // As long as there are bounces left
  private val counts   = Reg(Vec(config.array.contexts, chiselTypeOf(io.shading.bounces.get)))
  private val context  = path.bits.turn.context
  private val isTraced = counts(context) =/= io.shading.bounces.get
  when(path.fire && isTraced) { counts(context) := counts(context) + 1.U }
  when(io.begins.valid) { counts(io.begins.bits) := 0.U }

  path.ready              := io.turn.ready && (!isTraced || io.ray.ready)
  io.turn.valid           := path.valid && (!isTraced || io.ray.ready)
  io.turn.bits            := path.bits.turn
  io.ray.valid            := path.valid && isTraced && io.turn.ready
  io.ray.bits.context     := context
  io.ray.bits.isShadow    := false.B
  io.ray.bits.origin      := path.bits.origin
  io.ray.bits.dir         := path.bits.towards
  io.turned.valid         := path.fire
  io.turned.bits.context  := context
  io.turned.bits.isTraced := isTraced
  io.isRefraction         := path.bits.isRefraction

  private def waitBeside(room: RoomTurns): Unit = {
    val waiting   = ContextTable(config, new TurnedPath(config))
    val hasBeside = room.isThere && bounce.share.natural =/= 0.U

    // Out of the table: read, kept, and on its way
    val isRead  = RegNext(room.resume.fire, false.B)
    val isKept  = RegInit(false.B)
    val resumed = RegEnable(waiting.read(room.resume.bits.context, room.resume.fire), isRead)
    val beside  = RegEnable(room.resume.bits, room.resume.fire)
    room.resume.ready := !isRead && !isKept
    when(isRead) { isKept := true.B }.elsewhen(path.fire) { isKept := false.B }

    // Into it
    room.aside.valid := io.bounced.valid && hasBeside && !path.fire
    room.aside.bits  := bounce.context
    when(room.aside.valid) { waiting.write(bounce.context, direct) }

    path.valid       := isKept || (io.bounced.valid && !hasBeside)
    io.bounced.ready := Mux(hasBeside, !path.fire, path.ready && !isKept)
    when(isKept) {
      path.bits                     := resumed
      path.bits.turn.hasSurface.get := !beside.isBackground
    }

    room.ray.valid        := path.fire || room.aside.valid
    room.ray.bits.context := Mux(path.fire, path.bits.turn.context, bounce.context)
    val ray = room.ray.bits.ray
    ray.pixel   := DontCare
    ray.origin  := Mux(path.fire, path.bits.origin, io.bounced.bits.beside.get)
    ray.towards := path.bits.towards
    when(!path.fire) {
      ray.towards.axes.zip(bounce.reflection.axes).foreach { case (to, from) => to := from }
    }
  }
}

/** A path that turns, and the ray that goes on. */
final private class TurnedPath(config: ColonnadeConfig) extends Bundle {
  val turn         = new PathTurn(config)
  val isRefraction = Bool()
  val origin       = new BounceResult(config).origin.cloneType
  val towards      = new BounceResult(config).towards.cloneType
}
